"""Places of the head's surface that photos show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.dense.projection import Pinholes, Projection, project_places


@dataclass(frozen=True)
class Sightings:
    """M places of the head, each seen in a photo.

    Attributes:
        corners: (M, 3) vertices of the triangle that holds the place.
        barycentrics: (M, 3) in it.
        beside: (M, 3) mm, how far off that place this person's head has what is seen.
        photo: (M,).
        image_points: (M, 2) px.
        sigma_mm: (M,) error of the sighting on the surface.
    """

    corners: Int[Array, "m 3"]
    barycentrics: Float[Array, "m 3"]
    beside: Float[Array, "m 3"]
    photo: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_mm: Float[Array, " m"]

    def on(self, values: Float[Array, "... v c"]) -> Float[Array, "... m c"]:
        """Per-vertex values at the places."""
        return np.einsum("mc,...mcd->...md", self.barycentrics, values[..., self.corners, :])

    def of(self, keep: Bool[Array, " m"]) -> Sightings:
        """Some of them."""
        return Sightings(*(getattr(self, field.name)[keep] for field in fields(self)))

    def joined(self, other: Sightings) -> Sightings:
        """These and others of the same photos."""
        names = [field.name for field in fields(self)]
        return Sightings(
            *(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names)
        )


@dataclass(frozen=True)
class Misses:
    """How far cameras see M places from where the photos show them.

    Attributes:
        residuals: (M, 2) px.
        weights: (M,) 1 / px^2, Cauchy's over the error's variance.
        projection: with derivatives.
    """

    residuals: Float[Array, "m 2"]
    weights: Float[Array, " m"]
    projection: Projection


def measure_misses(
    sightings: Sightings, places: Float[Array, "m 3"], cameras: Sequence[Camera]
) -> Misses:
    """Where the cameras see the places, (M, 3) mm, less where they were found.

    Raises:
        EstimationError: a place lies behind its camera.
    """
    photo = sightings.photo
    seen = project_places(Pinholes.of(cameras), photo, places)
    principal = np.stack([camera.principal for camera in cameras])
    residuals = seen.image_points + principal[photo] - sightings.image_points
    px_per_mm = np.array([camera.focal_px / camera.t_cam_head[2] for camera in cameras])
    sigma = sightings.sigma_mm * px_per_mm[photo]
    _, share = loss_named("cauchy")((residuals**2).sum(axis=1) / sigma**2)
    return Misses(residuals, share / sigma**2, seen)
