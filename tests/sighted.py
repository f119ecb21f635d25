"""Sightings of places that are known exactly, by cameras that are known exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.dense.joint import Lenses, PlacePrior, Sightings
from people import camera

PLACES = 90


@dataclass(frozen=True)
class Scene:
    """Cameras, what they see, and the beliefs that shape and places are drawn from."""

    cameras: list[Camera]
    places: Array
    coefficients: Array
    sightings: Sightings
    prior: PlacePrior

    def lenses(self, deviation: float = 0.3) -> Lenses:
        """A lens for every photo, its focal length believed to be the true one."""
        focal = np.log([item.focal_px for item in self.cameras])
        return Lenses(np.arange(len(focal)), focal, np.full(len(focal), deviation))

    def starts(self, degrees: float = 2.0) -> list[Camera]:
        """The cameras turned by about so much, with lenses that are 5 % too long."""
        rng = np.random.default_rng(5)
        turns = rotation_from_vector(
            np.radians(degrees) * rng.normal(size=(len(self.cameras), 3)) / 2
        )
        return [
            replace(item, R_cam_head=turn @ item.R_cam_head, focal_px=1.05 * item.focal_px)
            for item, turn in zip(self.cameras, turns, strict=True)
        ]


def sighted(
    seed: int,
    yaws: tuple[float, ...],
    *,
    distance: float = 900.0,
    noise_px: float = 0.0,
    deviation_mm: float = 1.5,
) -> Scene:
    """A box of places, all of them seen by cameras at these yaws (degrees)."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform([-60, -80, -30], [60, 60, 40], size=(PLACES, 3))
    components = rng.normal(size=(4, PLACES, 3))
    coefficients = rng.normal(size=4)
    places = mean + np.tensordot(coefficients, components, 1)
    places += deviation_mm * rng.normal(size=places.shape)
    cameras = [camera(yaw, 4 * (-1) ** k, distance=distance) for k, yaw in enumerate(yaws)]
    cameras = [replace(item, focal_px=3.0 * distance) for item in cameras]
    image = np.concatenate([item.project(places) for item in cameras])
    count = len(cameras)
    sightings = Sightings(
        photo=np.repeat(np.arange(count), PLACES),
        place=np.tile(np.arange(PLACES), count),
        image_points=image + noise_px * rng.normal(size=image.shape),
        sigma_px=np.full(count * PLACES, max(noise_px, 0.05)),
        guides=np.ones(count * PLACES, bool),
    )
    prior = PlacePrior(mean, components, np.tile(np.eye(3) / deviation_mm**2, (PLACES, 1, 1)))
    return Scene(cameras, places, coefficients, sightings, prior)
