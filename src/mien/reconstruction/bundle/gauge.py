"""The gauge: moving, rotating and scaling head and cameras together changes no photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.numeric.rotation import cross_matrix
from mien.reconstruction.bundle.problem import BundleState
from mien.reconstruction.bundle.projection import POSE_SIZE

FREEDOMS = 7
"""Rotation vector, translation (mm) and log scale of head space."""


@dataclass(frozen=True)
class GaugeMotions:
    """The step that each gauge freedom makes.

    Attributes:
        cameras: (D, 7) of the cameras' unknowns.
        points: (N, 3, 7) mm.
    """

    cameras: Float[Array, "d 7"]
    points: Float[Array, "n 3 7"]


def gauge_motions(state: BundleState) -> GaugeMotions:
    """The motions that leave every point where it is in every photo."""
    R, t, points = state.R, state.t, state.points
    poses = np.zeros((len(R), POSE_SIZE, FREEDOMS))
    poses[:, :3, :3] = -R
    poses[:, 3:5, 3:6] = -R[:, :2]
    poses[:, 5, 3:6] = -R[:, 2] / t[:, 2:]
    poses[:, 3:5, 6], poses[:, 5, 6] = t[:, :2], 1.0
    focal = np.zeros((len(state.log_focal), FREEDOMS))
    translations = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return GaugeMotions(
        np.concatenate([poses.reshape(-1, FREEDOMS), focal]),
        np.concatenate([-cross_matrix(points), translations, points[..., None]], axis=2),
    )


def similarity_constraints(
    points: Float[Array, "n 3"], counts: Bool[Array, " n"]
) -> Float[Array, "n 7 3"]:
    """What a similarity changes of the points that count: their mean, their turn, their size."""
    spread = points - points[counts].mean(axis=0)
    spread = spread / np.sqrt((spread[counts] ** 2).mean())
    rows = np.concatenate(
        [np.tile(np.eye(3), (len(points), 1, 1)), cross_matrix(spread), spread[:, None]], axis=1
    )
    return rows * counts[:, None, None]
