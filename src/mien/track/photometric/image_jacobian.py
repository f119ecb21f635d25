"""Where each unknown moves the points of a head in the picture ([Pighin 2002] app. B)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.kernels.jit import njit
from mien.track.image.drawing import Lens, Pose, lens_of
from mien.track.image.frame_pyramid import View

POSE_UNKNOWNS = 7
"""Rotation vector ([Pighin 2002] app. B.2; from the left), translation mm, log focal length."""


class Flows(NamedTuple):
    """How far a step of 1 in each of the N unknowns moves what is drawn.

    Attributes:
        face: (V, N - 7, 2) float32 px, of every vertex, by the face's unknowns.
        t: (3,) mm of the pose.
        lens: focal length and principal point, px. With these, pose_flow is quicker than a look at
            three vertices.
        counted: (N,) float32: 1, or 0 where an unknown's motion is not to count.
    """

    face: Float[Array, "v p 2"]
    t: Float[Array, " 3"]
    lens: Lens
    counted: Float[Array, " n"]


def screen_flows(
    moves: Float[Array, "p v 3"], places: Float[Array, "v 3"], pose: Pose, view: View
) -> Flows:
    """Flows of the pose's seven unknowns and P of the face's.

    Source:
        [Pighin 2002] app. B.1, B.2.
    """
    face = np.empty((len(places), len(moves), 2), np.float32)
    lens = lens_of(view, pose)
    _flow_rows(moves, places, pose.R, lens[0], face)
    counted = np.ones(POSE_UNKNOWNS + len(moves), np.float32)
    return Flows(face, pose.t, lens, counted)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _flow_rows(moves: Array, places: Array, R: Array, focal: float, face: Array) -> None:
    for v in range(len(places)):
        scale = focal / places[v, 2]
        x, y = places[v, 0] / places[v, 2], places[v, 1] / places[v, 2]
        for p in range(len(moves)):
            a, b, c = moves[p, v, 0], moves[p, v, 1], moves[p, v, 2]
            dx = R[0, 0] * a + R[0, 1] * b + R[0, 2] * c
            dy = R[1, 0] * a + R[1, 1] * b + R[1, 2] * c
            dz = R[2, 0] * a + R[2, 1] * b + R[2, 2] * c
            face[v, p, 0] = scale * (dx - x * dz)
            face[v, p, 1] = scale * (dy - y * dz)


def vertex_flows(flows: Flows, places: Float[Array, "v 3"]) -> Float[Array, "v n 2"]:
    """(V, N, 2) px by which a step of 1 in each unknown moves each vertex, the pose's first."""
    pose = np.empty((len(places), POSE_UNKNOWNS, 2), np.float32)
    _pose_rows(places, flows.t, flows.lens[0], pose)
    return np.concatenate([pose, flows.face], axis=1)


@njit(cache=True, nogil=True, error_model="numpy")
def _pose_rows(places: Array, t: Array, focal: float, pose: Array) -> None:
    for v in range(len(places)):
        x, y = places[v, 0] / places[v, 2], places[v, 1] / places[v, 2]
        flow = pose_flow(x, y, places[v, 2], (t[0], t[1], t[2]), focal)
        for p in range(POSE_UNKNOWNS):
            pose[v, p, 0], pose[v, p, 1] = flow[p]


Pair = tuple[float, float]


@njit(inline="always")
def pose_flow(
    x: float, y: float, z: float, t: tuple[float, float, float], focal: float
) -> tuple[Pair, Pair, Pair, Pair, Pair, Pair, Pair]:
    """Px by which each of the pose's unknowns moves a point: f/z (dX - x dZ, dY - y dZ).

    Args:
        x: X/z and Y/z of the point, camera space.
        y: X/z and Y/z of the point, camera space.
        z: its depth.
    """
    scale = focal / z
    # R m, about which the head turns: the place less the translation.
    X, Y, Z = x * z - t[0], y * z - t[1], z - t[2]
    return (
        (scale * (-x * Y), scale * (-Z - y * Y)),
        (scale * (Z + x * X), scale * (y * X)),
        (scale * (-Y), scale * X),
        (scale, 0 * scale),
        (0 * scale, scale),
        (-scale * x, -scale * y),
        (focal * x, focal * y),
    )
