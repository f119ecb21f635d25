"""Points of the head's surface observed in photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.projection import PinholeArrays, Reprojection, project_points


@dataclass(frozen=True)
class SurfaceObservations:
    """M points of the head's surface, each observed in a photo.

    Attributes:
        corners: (M, 3) vertices of the triangle that holds the point.
        barycentrics: (M, 3) in it.
        offset: (M, 3) mm from that point to what is observed, on this person's head.
        photo: (M,) index of the photo.
        image_points: (M, 2) px.
        sigma_mm: (M,) standard deviation of the observation on the surface.
    """

    corners: Int[Array, "m 3"]
    barycentrics: Float[Array, "m 3"]
    offset: Float[Array, "m 3"]
    photo: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_mm: Float[Array, " m"]

    def on(self, values: Float[Array, "... v c"]) -> Float[Array, "... m c"]:
        """Per-vertex values at the surface points."""
        return np.einsum("mc,...mcd->...md", self.barycentrics, values[..., self.corners, :])

    def of(self, keep: Bool[Array, " m"]) -> SurfaceObservations:
        """Some of the observations."""
        return SurfaceObservations(*(getattr(self, field.name)[keep] for field in fields(self)))

    def joined(self, other: SurfaceObservations) -> SurfaceObservations:
        """These and others of the same photos."""
        names = [field.name for field in fields(self)]
        return SurfaceObservations(
            *(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names)
        )


def reproject(
    observations: SurfaceObservations, points: Float[Array, "m 3"], cameras: Sequence[Camera]
) -> Reprojection:
    """Reprojection errors of points, (M, 3) mm, with Cauchy weights.

    Raises:
        EstimationError: a point lies behind its camera.
    """
    photo = observations.photo
    projection = project_points(PinholeArrays.of(cameras), photo, points)
    principal = np.stack([camera.principal for camera in cameras])
    residuals = projection.image_points + principal[photo] - observations.image_points
    px_per_mm = np.array([camera.focal_px / camera.t_cam_head[2] for camera in cameras])
    sigma = observations.sigma_mm * px_per_mm[photo]
    _, loss_weights = loss_named("cauchy")((residuals**2).sum(axis=1) / sigma**2)
    return Reprojection(projection, residuals, loss_weights / sigma**2)
