"""Places as photos see them, with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.camera import Camera
from mien.errors import EstimationError

UNKNOWNS = 7
"""Of a photo: rotation vector (rad), shift in x and y (mm), log depth, log focal length."""


@dataclass(frozen=True)
class Pinholes:
    """K cameras as arrays.

    Attributes:
        R: (K, 3, 3) R_cam_head.
        t: (K, 3) mm, t_cam_head.
        focal_px: (K,).
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    focal_px: Float[Array, " k"]

    @classmethod
    def of(cls, cameras: Sequence[Camera]) -> Pinholes:
        """The same of cameras, less their principal points."""
        return cls(
            np.stack([camera.R_cam_head for camera in cameras]),
            np.stack([camera.t_cam_head for camera in cameras]),
            np.array([camera.focal_px for camera in cameras]),
        )


@dataclass(frozen=True)
class Projection:
    """M places, each seen by a photo.

    Attributes:
        image_points: (M, 2) px, less the principal point.
        by_place: (M, 2, 3) px / mm, derivatives by the place in head space.
        turned: (M, 3) mm, R_cam_head times the place.
        by_turned: (M, 2, 3) derivatives by it.
        depth: (M,) mm, the t_z of the photo.
    """

    image_points: Float[Array, "m 2"]
    by_place: Float[Array, "m 2 3"]
    turned: Float[Array, "m 3"]
    by_turned: Float[Array, "m 2 3"]
    depth: Float[Array, " m"]

    def by_camera(self) -> Float[Array, "m 2 7"]:
        """Derivatives by the UNKNOWNS; a rotation vector turns the camera's own space."""
        derivatives = np.empty((len(self.depth), 2, UNKNOWNS))
        for row in range(2):
            derivatives[:, row, :3] = _cross(self.turned, self.by_turned[:, row])
        derivatives[..., 3:5] = self.by_turned[..., :2]
        derivatives[..., 5] = self.by_turned[..., 2] * self.depth[:, None]
        derivatives[..., 6] = self.image_points
        return derivatives


def project_places(
    pinholes: Pinholes, photo: Int[Array, " m"], places: Float[Array, "m 3"]
) -> Projection:
    """Place m, (M, 3) mm in head space, as photo[m] sees it.

    Raises:
        EstimationError: a place lies behind its camera.
    """
    R, t = pinholes.R[photo], pinholes.t[photo]
    turned = (R @ places[..., None])[..., 0]
    x, y, z = (turned + t).T
    if not (z > 0).all():
        raise EstimationError("a place on the head has come to lie behind a camera that sees it")
    scale = pinholes.focal_px[photo] / z
    by_turned = np.zeros((len(places), 2, 3))
    by_turned[:, 0, 0] = by_turned[:, 1, 1] = scale
    by_turned[:, 0, 2], by_turned[:, 1, 2] = -scale * x / z, -scale * y / z
    image_points = np.column_stack([scale * x, scale * y])
    return Projection(image_points, by_turned @ R, turned, by_turned, t[:, 2])


def _cross(a: Float[Array, "m 3"], b: Float[Array, "m 3"]) -> Float[Array, "m 3"]:
    # Much faster than np.cross on so many short vectors.
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.column_stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
