"""Where each unknown moves the points of a head in the picture (P02 app. B)."""

from __future__ import annotations

import numpy as np
from numba import njit

from mien.arrays import Array, Float
from mien.track.drawing import Pose
from mien.track.views import View

POSE_UNKNOWNS = 7
"""Rotation vector (applied from the left, P02 app. B.2), translation mm, log focal length."""


def screen_flows(
    moves: Float[Array, "p v 3"], places: Float[Array, "v 3"], pose: Pose, view: View
) -> Float[Array, "v n 2"]:
    """(V, 7 + P, 2) px by which a step of 1 in each unknown moves each vertex, the pose's first.

    Source: P02 app. B.1, B.2.
    """
    flows = np.empty((len(places), POSE_UNKNOWNS + len(moves), 2), np.float32)
    _flow_rows(moves, places, pose.R, pose.t, view.focal * pose.zoom, flows)
    return flows


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _flow_rows(moves: Array, places: Array, R: Array, t: Array, focal: float, flows: Array) -> None:
    pose = np.empty((POSE_UNKNOWNS, 2))
    for v in range(len(places)):
        scale = focal / places[v, 2]
        x, y = places[v, 0] / places[v, 2], places[v, 1] / places[v, 2]
        pose_flow(x, y, places[v, 2], t, focal, pose)
        for p in range(POSE_UNKNOWNS):
            flows[v, p, 0], flows[v, p, 1] = pose[p, 0], pose[p, 1]
        for p in range(len(moves)):
            a, b, c = moves[p, v, 0], moves[p, v, 1], moves[p, v, 2]
            dx = R[0, 0] * a + R[0, 1] * b + R[0, 2] * c
            dy = R[1, 0] * a + R[1, 1] * b + R[1, 2] * c
            dz = R[2, 0] * a + R[2, 1] * b + R[2, 2] * c
            flows[v, POSE_UNKNOWNS + p, 0] = scale * (dx - x * dz)
            flows[v, POSE_UNKNOWNS + p, 1] = scale * (dy - y * dz)


@njit(inline="always")
def pose_flow(x: float, y: float, z: float, t: Array, focal: float, flow: Array) -> None:
    """Fill in px by which each unknown moves a point at depth z: f/z (dX - x dZ, dY - y dZ).

    Args:
        x, y: X/z and Y/z of the point, camera space.
    """
    scale = focal / z
    # R m, about which the head turns: the place less the translation.
    X, Y, Z = x * z - t[0], y * z - t[1], z - t[2]
    flow[0, 0], flow[0, 1] = scale * (-x * Y), scale * (-Z - y * Y)
    flow[1, 0], flow[1, 1] = scale * (Z + x * X), scale * (y * X)
    flow[2, 0], flow[2, 1] = scale * (-Y), scale * X
    flow[3, 0], flow[3, 1] = scale, 0.0
    flow[4, 0], flow[4, 1] = 0.0, scale
    flow[5, 0], flow[5, 1] = -scale * x, -scale * y
    flow[6, 0], flow[6, 1] = focal * x, focal * y
