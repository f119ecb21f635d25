"""The frame: moving, turning and scaling head and cameras together changes no photo.

Beliefs alone tell the frame. The instruments of the cameras' equations do not know that, and
their noise would drive head and cameras away together. So those sums of the cameras' equations
alone count that move the cameras apart, and seven others say that no motion of the frame brings
cameras and places nearer to what is believed of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.rotation import cross_matrix
from mien.reconstruction.dense.joint_points import Elimination, JointProblem, Misfit, Rows, flat
from mien.reconstruction.dense.joint_problem import JointState

FREEDOMS = 7
"""Rotation vector, shift (mm) and log scale of head space."""
_MOVING = 1e-6
"""A motion that moves the images by less than this share of another moves no camera."""


@dataclass(frozen=True)
class Motions:
    """What each freedom of the frame does.

    Attributes:
        of_cameras: (D, 7) to the cameras' unknowns.
        of_places: (N, 3, 7) mm.
    """

    of_cameras: Float[Array, "d 7"]
    of_places: Float[Array, "n 3 7"]


def frame_motions(state: JointState) -> Motions:
    """Those that leave every place where it is in every photo."""
    R, t, places = state.R, state.t, state.places
    poses = np.zeros((len(R), 6, FREEDOMS))
    poses[:, :3, :3] = -R
    poses[:, 3:5, 3:6] = -R[:, :2]
    poses[:, 5, 3:6] = -R[:, 2] / t[:, 2:]
    poses[:, 3:5, 6], poses[:, 5, 6] = t[:, :2], 1.0
    focal = np.zeros((len(state.log_focal), FREEDOMS))
    shifts = np.broadcast_to(np.eye(3), (len(places), 3, 3))
    return Motions(
        np.concatenate([poses.reshape(-1, FREEDOMS), focal]),
        np.concatenate([-cross_matrix(places), shifts, places[..., None]], axis=2),
    )


def with_frame(
    cameras: Rows, problem: JointProblem, state: JointState, misfit: Misfit, places: Elimination
) -> Rows:
    """As many equations as those of the cameras, but the frame is told by beliefs."""
    motions = frame_motions(state)
    apart, along = _split(problem, misfit, motions)
    frame = _frame_rows(problem, state, motions, places)
    return Rows(
        np.concatenate([apart @ cameras.matrix, along @ frame.matrix]),
        np.append(apart @ cameras.right, along @ frame.right),
    )


def _split(
    problem: JointProblem, misfit: Misfit, motions: Motions
) -> tuple[Float[Array, "e d"], Float[Array, "f 7"]]:
    """Directions of the cameras' unknowns that change the images otherwise than the frame's do,

    and those of the frame's motions that move cameras.

    A longer lens farther away is one of the former, though the depth alone is nearly the frame's
    scale. One photo's camera does not move when the head grows away from it.
    """
    by_camera = misfit.seen.by_camera()
    weighted = np.swapaxes(misfit.weights[:, None, None] * by_camera, 1, 2)
    felt = problem.believed.lenses.by_unknowns(problem.by_photo(weighted @ by_camera))
    felt += np.diag(problem.believed.precision)
    strength = np.sqrt(np.diagonal(felt))
    moved = (felt @ motions.of_cameras) / strength[:, None]
    size = np.linalg.norm(moved, axis=0)
    axes, stretch, shares = np.linalg.svd(moved / size)
    moving = np.count_nonzero(stretch > _MOVING * stretch[0])
    return axes[:, moving:].T / strength, shares[:moving] / size


def _frame_rows(
    problem: JointProblem, state: JointState, motions: Motions, places: Elimination
) -> Rows:
    """By beliefs: sum P (d + x - B c) along each motion, and the same of the cameras."""
    believed = problem.believed
    by_place = problem.prior.precision @ motions.of_places
    by_camera = motions.of_cameras.T * believed.precision
    by_shape = -flat(by_place).T @ problem.basis
    right = -by_camera @ believed.off(state) - places.own.pull.ravel() @ flat(motions.of_places)
    return places.eliminate(by_place, Rows(np.concatenate([by_camera, by_shape], axis=1), right))
