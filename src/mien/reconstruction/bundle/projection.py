"""Projection of points by pinhole cameras, with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.camera import Camera
from mien.errors import EstimationError

CAMERA_SIZE = 7
"""Parameters of a camera step: rotation vector (rad), translation in x and y (mm), log depth, log
focal length."""
POSE_SIZE = CAMERA_SIZE - 1
"""Those of its pose: all but the focal length."""


@dataclass(frozen=True)
class PinholeArrays:
    """K cameras as arrays, principal points at the origin.

    Attributes:
        R: (K, 3, 3) R_cam_head.
        t: (K, 3) mm, t_cam_head.
        focal_px: (K,).
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    focal_px: Float[Array, " k"]

    @classmethod
    def of(cls, cameras: Sequence[Camera]) -> PinholeArrays:
        """Rotations, translations and focal lengths of the cameras."""
        return cls(
            np.stack([camera.R_cam_head for camera in cameras]),
            np.stack([camera.t_cam_head for camera in cameras]),
            np.array([camera.focal_px for camera in cameras]),
        )


@dataclass(frozen=True)
class Projection:
    """M points, each projected by one camera.

    Attributes:
        image_points: (M, 2) px, relative to the principal point.
        point_jacobian: (M, 2, 3) px / mm, derivatives with respect to the point in head space.
        rotated: (M, 3) mm, R_cam_head times the point.
        rotated_jacobian: (M, 2, 3) derivatives with respect to the rotated point.
        depth: (M,) mm, t_z of the camera.
    """

    image_points: Float[Array, "m 2"]
    point_jacobian: Float[Array, "m 2 3"]
    rotated: Float[Array, "m 3"]
    rotated_jacobian: Float[Array, "m 2 3"]
    depth: Float[Array, " m"]

    def camera_jacobian(self) -> Float[Array, "m 2 7"]:
        """Derivatives with respect to a camera step; its rotation is applied after R_cam_head."""
        jacobian = np.empty((len(self.depth), 2, CAMERA_SIZE))
        for row in range(2):
            jacobian[:, row, :3] = _cross(self.rotated, self.rotated_jacobian[:, row])
        jacobian[..., 3:5] = self.rotated_jacobian[..., :2]
        jacobian[..., 5] = self.rotated_jacobian[..., 2] * self.depth[:, None]
        jacobian[..., 6] = self.image_points
        return jacobian


def project_points(
    cameras: PinholeArrays, photo: Int[Array, " m"], points: Float[Array, "m 3"]
) -> Projection:
    """Projection of point m, (M, 3) mm in head space, by camera photo[m].

    Raises:
        EstimationError: a point lies behind its camera.
    """
    R, t = cameras.R[photo], cameras.t[photo]
    rotated = (R @ points[..., None])[..., 0]
    x, y, z = (rotated + t).T
    if not (z > 0).all():
        raise EstimationError("a place on the head has come to lie behind a camera that sees it")
    scale = cameras.focal_px[photo] / z
    rotated_jacobian = np.zeros((len(points), 2, 3))
    rotated_jacobian[:, 0, 0] = rotated_jacobian[:, 1, 1] = scale
    rotated_jacobian[:, 0, 2], rotated_jacobian[:, 1, 2] = -scale * x / z, -scale * y / z
    image_points = np.column_stack([scale * x, scale * y])
    return Projection(image_points, rotated_jacobian @ R, rotated, rotated_jacobian, t[:, 2])


@dataclass(frozen=True)
class Reprojection:
    """Reprojection errors of M observations.

    Attributes:
        projection: of the observed points, with derivatives.
        residuals: (M, 2) px, projected less observed.
        weights: (M,) 1 / px^2, of a robust loss over the variance.
    """

    projection: Projection
    residuals: Float[Array, "m 2"]
    weights: Float[Array, " m"]


def _cross(a: Float[Array, "m 3"], b: Float[Array, "m 3"]) -> Float[Array, "m 3"]:
    # Much faster than np.cross on so many short vectors.
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.column_stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
