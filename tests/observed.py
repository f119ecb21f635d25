"""Exact points observed by exact cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.problem import FocalGroups, Observations, PointPrior
from people import camera

POINTS = 90


@dataclass(frozen=True)
class Scene:
    """Cameras, what they see, and the beliefs that shape and points are drawn from."""

    cameras: list[Camera]
    points: Array
    coefficients: Array
    observations: Observations
    prior: PointPrior

    def focal(self, deviation: float = 0.3) -> FocalGroups:
        """A lens for every photo, its focal length believed to be the true one."""
        focal = np.log([item.focal_px for item in self.cameras])
        return FocalGroups(np.arange(len(focal)), focal, np.full(len(focal), deviation))

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


def observed(
    seed: int,
    yaws: tuple[float, ...],
    *,
    distance: float = 900.0,
    noise_px: float = 0.0,
    deviation_mm: float = 1.5,
) -> Scene:
    """A box of points, all of them seen by cameras at these yaws (degrees)."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform([-60, -80, -30], [60, 60, 40], size=(POINTS, 3))
    components = rng.normal(size=(4, POINTS, 3))
    coefficients = rng.normal(size=4)
    points = mean + np.tensordot(coefficients, components, 1)
    points += deviation_mm * rng.normal(size=points.shape)
    cameras = [camera(yaw, 4 * (-1) ** k, distance=distance) for k, yaw in enumerate(yaws)]
    cameras = [replace(item, focal_px=3.0 * distance) for item in cameras]
    image = np.concatenate([item.project(points) for item in cameras])
    count = len(cameras)
    observations = Observations(
        photo=np.repeat(np.arange(count), POINTS),
        point=np.tile(np.arange(POINTS), count),
        image_points=image + noise_px * rng.normal(size=image.shape),
        sigma_px=np.full(count * POINTS, max(noise_px, 0.05)),
        for_cameras=np.ones(count * POINTS, bool),
    )
    prior = PointPrior(mean, components, np.tile(np.eye(3) / deviation_mm**2, (POINTS, 1, 1)))
    return Scene(cameras, points, coefficients, observations, prior)
