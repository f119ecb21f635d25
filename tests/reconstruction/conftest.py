"""Exact synthetic scenes: a head-like set of points before cameras that are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from mien.camera import Camera
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.numeric.similarity import estimate_similarity

SIZE = (1000, 1300)


@dataclass(frozen=True)
class Scene:
    """Points of a person, the generic points one would start from, and what cameras see."""

    generic: np.ndarray
    points: np.ndarray
    components: np.ndarray
    cameras: list[Camera]
    image_points: np.ndarray

    @property
    def sizes(self):
        return np.tile(SIZE, (len(self.cameras), 1))

    def errors(self, cameras, points):
        """(degrees, relative focal length, mm) after the similarity between points seen twice."""
        twice = np.isfinite(self.image_points[..., 0]).sum(axis=0) >= 2
        move = estimate_similarity(points[twice], self.points[twice])
        found = np.stack([camera.R_cam_head for camera in cameras]) @ move.rotation.T
        true = np.stack([camera.R_cam_head for camera in self.cameras])
        focal = np.array([camera.focal_px for camera in cameras])
        true_focal = np.array([camera.focal_px for camera in self.cameras])
        off = np.linalg.norm(move(points) - self.points, axis=1)[twice]
        return np.rad2deg(angle_between(found, true)), np.abs(focal / true_focal - 1), off


SceneMaker = Callable[..., Scene]


@pytest.fixture
def make_scene() -> SceneMaker:
    """scene(seed, ...): see `synthetic_scene`."""
    return synthetic_scene


def synthetic_scene(
    seed=0, *, yaws=(-50, -25, 0, 25, 50), noise=0.0, count=60, distance=(500, 1200), hidden=True
) -> Scene:
    """Cameras at these yaws (degrees) before an ellipsoid with a nose and smooth changes."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(40 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[(directions[:, 2] > -0.1) & (np.abs(directions[:, 1]) < 0.8)][:count]
    axes = np.array([75.0, 110.0, 95.0])
    generic, normals = directions * axes, directions / axes
    generic[:, 2] += 20 * np.exp(-((generic[:, :2] / [14, 22]) ** 2).sum(axis=1)) - 95
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    components = smooth_components(generic)
    points = generic + np.tensordot(rng.normal(size=len(components)), components, 1)
    cameras = [random_camera(rng, yaw, points.mean(axis=0), distance) for yaw in yaws]
    image_points = np.stack([camera.project(points) for camera in cameras])
    image_points += noise * rng.normal(size=image_points.shape)
    view = np.stack([camera.center for camera in cameras])[:, None] - points
    facing = (view * normals).sum(axis=-1) / np.linalg.norm(view, axis=-1)
    if hidden:
        image_points[facing < 0.1] = np.nan
    return Scene(generic, points, components, cameras, image_points)


def smooth_components(points):
    """(9, N, 3): three long waves along each axis, 2 mm each."""
    waves = np.stack([np.sin(points @ np.array(k) / 60) for k in ((1, 1, 0), (0, 1, 1), (1, 0, 1))])
    return 2 * np.einsum("wn,ij->winj", waves, np.eye(3)).reshape(9, len(points), 3)


def random_camera(rng, yaw, target, distance) -> Camera:
    turns = rotation_from_vector(
        np.deg2rad([[0, 0, rng.uniform(-5, 5)], [rng.uniform(-15, 15), 0, 0], [0, yaw, 0]])
    )
    rotation = turns[0] @ turns[1] @ np.diag([1.0, -1, -1]) @ turns[2]
    depth = rng.uniform(*distance)
    place = np.array([rng.uniform(-10, 10), rng.uniform(-10, 10), depth])
    return Camera(*SIZE, 3.8 * depth, rotation, place - rotation @ target)
