"""A pinhole camera in head space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float, check_array, check_positive, check_rotation, frozen

FRONTAL = frozen(np.diag([1.0, -1.0, -1.0]))
"""(3, 3) R_cam_head of an upright head that faces the camera."""


@dataclass(frozen=True)
class Camera:
    """Perspective projection with square pixels and no distortion.

    Camera space: x right, y down, z forward, millimetres. Pixels: origin at the top-left corner
    of the image, centre of the first pixel at (0.5, 0.5).

    Attributes:
        width: of the image, px.
        height: of the image, px.
        focal_px: focal length in px.
        R_cam_head: (3, 3) rotation from head space to camera space.
        t_cam_head: (3,) mm, position of the head's origin in camera space.
        principal_px: (2,) px, where the optical axis meets the image; its centre unless known.

    Raises:
        InputError: a size or focal length that is not positive, a matrix that is no rotation.
    """

    width: int
    height: int
    focal_px: float
    R_cam_head: Float[Array, "3 3"]
    t_cam_head: Float[Array, " 3"]
    principal_px: Float[Array, " 2"] | None = None

    def __post_init__(self) -> None:
        for name in ("width", "height", "focal_px"):
            check_positive(name, getattr(self, name))
        principal = self.principal_px
        if principal is None:
            principal = np.array([self.width / 2, self.height / 2])
        for name, array in (
            ("R_cam_head", check_rotation("R_cam_head", self.R_cam_head)),
            ("t_cam_head", check_array("t_cam_head", self.t_cam_head, (3,))),
            ("principal_px", check_array("principal_px", principal, (2,))),
        ):
            object.__setattr__(self, name, frozen(array))

    @property
    def principal(self) -> Float[Array, " 2"]:
        """(2,) px; never None."""
        assert self.principal_px is not None
        return self.principal_px

    @property
    def center(self) -> Float[Array, " 3"]:
        """(3,) mm: the camera's position in head space."""
        return -self.R_cam_head.T @ self.t_cam_head

    def to_camera(self, points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """Head space to camera space, mm."""
        return points @ self.R_cam_head.T + self.t_cam_head

    def project(self, points: Float[Array, "n 3"]) -> Float[Array, "n 2"]:
        """Head space in mm to pixels. A point at depth 0 or less has no meaningful image."""
        in_camera = self.to_camera(points)
        return self.focal_px * in_camera[:, :2] / in_camera[:, 2:] + self.principal

    def unproject(
        self, image_points: Float[Array, "n 2"], depth: Float[Array, " n"]
    ) -> Float[Array, "n 3"]:
        """Pixels and depths (camera z, mm) to head space, mm: the inverse of project."""
        xy = (image_points - self.principal) / self.focal_px * depth[:, None]
        in_camera = np.column_stack([xy, depth])
        return (in_camera - self.t_cam_head) @ self.R_cam_head

    def ray_directions(self, image_points: Float[Array, "n 2"]) -> Float[Array, "n 3"]:
        """Unit directions in head space of the rays that leave `center` through the pixels."""
        directions = self.unproject(image_points, np.ones(len(image_points))) - self.center
        return directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def resized(self, factor: float) -> Camera:
        """The same view on an image scaled by this factor (sizes rounded)."""
        return replace(
            self,
            width=max(1, round(self.width * factor)),
            height=max(1, round(self.height * factor)),
            focal_px=self.focal_px * factor,
            principal_px=self.principal * factor,
        )


def head_angles_deg(camera: Camera) -> tuple[float, float, float]:
    """Degrees of yaw, pitch and roll of the head before the camera (docs/reference/conventions.md).

    The same three angles given to `mien render` show the head turned like that.
    """
    # The head's x (subject's left), y (up) and z (out of the face) as the camera has them.
    left, up, out = camera.R_cam_head.T
    yaw = np.degrees(np.arctan2(left[2], -out[2]))
    pitch = np.degrees(np.arcsin(np.clip(-up[2], -1, 1)))
    roll = np.degrees(np.arctan2(-up[0], -up[1]))
    return float(yaw), float(pitch), float(roll)
