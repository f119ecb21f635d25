"""Jacobian of image points by the unknowns: pose and face ([Pighin 2002] app. B)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.kernels.jit import njit
from mien.track.image.drawing import Pose
from mien.track.image.frame_pyramid import FrameCrop, Intrinsics

POSE_UNKNOWNS = 7
"""Rotation vector ([Pighin 2002] app. B.2; from the left), translation mm, log focal length."""
ROTATION, TRANSLATION, LOG_FOCAL = slice(0, 3), slice(3, 6), 6
"""Where these are among the unknowns."""


class ImageJacobian(NamedTuple):
    """How far a step of 1 in each of the N unknowns moves what is drawn.

    Attributes:
        face: (V, N - 7, 2) float32 px, of every vertex, by the face's unknowns.
        t: (3,) mm, translation of the pose. The pose's own columns are computed from it at every
            pixel (pose_jacobian), which is quicker than interpolation between three vertices.
        intrinsics: of the camera.
        active: (N,) float32: 1, or 0 for an unknown whose motion is left out.
    """

    face: Float[Array, "v p 2"]
    t: Float[Array, " 3"]
    intrinsics: Intrinsics
    active: Float[Array, " n"]


def image_jacobian(
    offsets: Float[Array, "p v 3"], positions: Float[Array, "v 3"], pose: Pose, crop: FrameCrop
) -> ImageJacobian:
    """Jacobian by the pose's seven unknowns and P of the face's.

    Args:
        offsets: mm by which a step of 1 in each of the face's unknowns moves each vertex.
        positions: mm, of the vertices in camera space.
        pose: of the head.
        crop: that it is drawn for.

    Source:
        [Pighin 2002] app. B.1, B.2.
    """
    face = np.empty((len(positions), len(offsets), 2), np.float32)
    intrinsics = crop.intrinsics(pose.zoom)
    _face_jacobian_rows(offsets, positions, pose.R, intrinsics.focal, face)
    active = np.ones(POSE_UNKNOWNS + len(offsets), np.float32)
    return ImageJacobian(face, pose.t, intrinsics, active)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _face_jacobian_rows(
    offsets: Array, positions: Array, R: Array, focal: float, face: Array
) -> None:
    for v in range(len(positions)):
        scale = focal / positions[v, 2]
        x, y = positions[v, 0] / positions[v, 2], positions[v, 1] / positions[v, 2]
        for p in range(len(offsets)):
            a, b, c = offsets[p, v, 0], offsets[p, v, 1], offsets[p, v, 2]
            dx = R[0, 0] * a + R[0, 1] * b + R[0, 2] * c
            dy = R[1, 0] * a + R[1, 1] * b + R[1, 2] * c
            dz = R[2, 0] * a + R[2, 1] * b + R[2, 2] * c
            face[v, p, 0] = scale * (dx - x * dz)
            face[v, p, 1] = scale * (dy - y * dz)


def vertex_jacobian(
    jacobian: ImageJacobian, positions: Float[Array, "v 3"]
) -> Float[Array, "v n 2"]:
    """(V, N, 2) px by which a step of 1 in each unknown moves each vertex, the pose's first."""
    pose = np.empty((len(positions), POSE_UNKNOWNS, 2), np.float32)
    _pose_jacobian_rows(positions, jacobian.t, jacobian.intrinsics.focal, pose)
    return np.concatenate([pose, jacobian.face], axis=1)


@njit(cache=True, nogil=True, error_model="numpy")
def _pose_jacobian_rows(positions: Array, t: Array, focal: float, pose: Array) -> None:
    for v in range(len(positions)):
        x, y = positions[v, 0] / positions[v, 2], positions[v, 1] / positions[v, 2]
        by_pose = pose_jacobian(x, y, positions[v, 2], (t[0], t[1], t[2]), focal)
        for p in range(POSE_UNKNOWNS):
            pose[v, p, 0], pose[v, p, 1] = by_pose[p]


Pair = tuple[float, float]


@njit(inline="always")
def pose_jacobian(
    x: float, y: float, z: float, t: tuple[float, float, float], focal: float
) -> tuple[Pair, Pair, Pair, Pair, Pair, Pair, Pair]:
    """Derivatives of an image point by the pose's unknowns: f/z (dX - x dZ, dY - y dZ).

    Args:
        x: X/z of the point, camera space.
        y: Y/z of the point, camera space.
        z: its depth, mm.
        t: mm, translation of the head.
        focal: px.

    Returns:
        px by each of rotation (3), translation (3) and log focal length.
    """
    scale = focal / z
    # R m, the point about the head's origin: its position less the translation.
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
