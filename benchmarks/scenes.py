"""Random people before random cameras: feature points with everything known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.adjustment import ShapePrior

__all__ = [
    "FeatureHead",
    "Scene",
    "generic_features",
    "long_lens_pair",
    "random_scene",
]

_IMAGE_SIZES = ((1000, 1300), (1200, 1600), (900, 1200))
_HEAD_HEIGHT_MM = 300.0
"""What fills an image's height at scale 1."""
_LEAST_FACING = 0.1
"""Cosine between normal and view below which a point counts as hidden."""


@dataclass(frozen=True)
class FeatureHead:
    """Feature points of the generic head and how people differ.

    Attributes:
        points: (N, 3) mm, the first `first` of them [Pighin 2002]'s 13.
        normals: (N, 3) outward.
        components: (C, N, 3) mm, for independent coefficients of deviation 1.
        detail_mm: deviation of what the components leave out.
    """

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]
    components: Float[Array, "c n 3"]
    detail_mm: float
    first: int = 13

    def prior(self) -> ShapePrior:
        """What pose recovery may know of a person beforehand."""
        return ShapePrior(self.points, self.components, np.full(len(self.points), self.detail_mm))

    def of(self, chosen: Array) -> FeatureHead:
        """Some of the points."""
        return FeatureHead(
            self.points[chosen], self.normals[chosen], self.components[:, chosen], self.detail_mm
        )


@dataclass(frozen=True)
class Scene:
    """A person, the cameras, and where they see the person's points.

    Attributes:
        points: (N, 3) mm.
        cameras: K.
        image_points: (K, N, 2) px with noise, NaN where hidden.
        sizes: (K, 2) px.
    """

    points: Float[Array, "n 3"]
    cameras: tuple[Camera, ...]
    image_points: Float[Array, "k n 2"]

    @property
    def sizes(self) -> Float[Array, "k 2"]:
        return np.array([[camera.width, camera.height] for camera in self.cameras], float)


def generic_features(*, more: int = 99, detail_mm: float = 1.0) -> FeatureHead:
    """[Pighin 2002]'s 13 points and `more` others, spread evenly over the generic head's polylines.

    What the identity basis leaves out of a person is taken to be `detail_mm` at every point.
    """
    generic = load_generic_head()
    first = list(generic.points.values())
    others = dict.fromkeys(vertex for line in generic.polylines.values() for vertex in line)
    rest = [vertex for vertex in others if vertex not in first]
    spread = np.linspace(0, len(rest) - 1, min(more, len(rest))).round().astype(int)
    chosen = np.array(first + [rest[index] for index in spread])
    return FeatureHead(
        generic.mesh.vertices[chosen].astype(float),
        generic.mesh.vertex_normals()[chosen],
        generic.identity.components[:, chosen].astype(float),
        detail_mm,
    )


def random_scene(
    rng: np.random.Generator,
    head: FeatureHead,
    *,
    yaws: Sequence[float] = (-60, -30, 0, 30, 60),
    noise_px: float = 1.0,
    distance_mm: tuple[float, float] = (600, 2000),
    detail_mm: float | None = None,
    hidden: bool = True,
) -> Scene:
    """A random person before cameras around the face.

    Args:
        yaws: degrees, one a camera, each varied by 8 degrees; pitch within 15, roll within 5.
        distance_mm: range of the cameras' distances; the head fills every image.
        detail_mm: deviation of what the components leave out; the head's own unless given.
        hidden: points whose normal turns away are not seen.
    """
    detail = head.detail_mm if detail_mm is None else detail_mm
    coefficients = rng.normal(size=len(head.components))
    points = head.points + np.tensordot(coefficients, head.components, 1)
    points = points + detail * rng.normal(size=points.shape)
    cameras = tuple(_random_camera(rng, yaw, points.mean(axis=0), distance_mm) for yaw in yaws)
    image_points = np.full((len(cameras), len(points), 2), np.nan)
    for camera, seen_at in zip(cameras, image_points, strict=True):
        view = camera.center - points
        facing = (view * head.normals).sum(axis=1) / np.linalg.norm(view, axis=1)
        seen = facing > _LEAST_FACING if hidden else np.ones(len(points), bool)
        projected = camera.project(points) + noise_px * rng.normal(size=(len(points), 2))
        seen_at[seen] = projected[seen]
    return Scene(points, cameras, image_points)


def long_lens_pair(
    rng: np.random.Generator,
    head: FeatureHead,
    *,
    noise_px: float = 1.5,
    principal_off_px: float = 90.0,
) -> Scene:
    """Two nearly affine views: 6,400 px from 1.5 m, 48 degrees apart, cropped off centre.

    The cameras' principal points lie off the image centres by about `principal_off_px` along each
    axis, as those of photos that were cropped.
    """
    exact = random_scene(rng, head, yaws=(-24, 24), noise_px=0, distance_mm=(1450, 1550))
    cameras, image_points = [], []
    for camera, seen_at in zip(exact.cameras, exact.image_points, strict=True):
        off = principal_off_px * rng.choice([-1, 1], 2) * rng.uniform(0.7, 1.1, 2)
        camera = replace(
            camera,
            width=1200,
            height=1600,
            focal_px=rng.uniform(6300, 6500),
            principal_px=np.array([600.0, 800.0]) + off,
        )
        noisy = camera.project(exact.points) + noise_px * rng.normal(size=seen_at.shape)
        image_points.append(np.where(np.isfinite(seen_at), noisy, np.nan))
        cameras.append(camera)
    return Scene(exact.points, tuple(cameras), np.stack(image_points))


def _random_camera(
    rng: np.random.Generator,
    yaw: float,
    target: Float[Array, " 3"],
    distance_mm: tuple[float, float],
) -> Camera:
    yaw = np.deg2rad(yaw + rng.uniform(-8, 8))
    pitch, roll = np.deg2rad(rng.uniform(-15, 15)), np.deg2rad(rng.uniform(-5, 5))
    turn = rotation_from_vector(np.array([[0, 0, roll], [pitch, 0, 0], [0, yaw, 0]]))
    rotation = turn[0] @ turn[1] @ np.diag([1.0, -1.0, -1.0]) @ turn[2]
    width, height = _IMAGE_SIZES[rng.integers(len(_IMAGE_SIZES))]
    distance = rng.uniform(*distance_mm)
    scale = rng.uniform(0.8, 1.0) * height / _HEAD_HEIGHT_MM
    place = np.array([rng.uniform(-10, 10), rng.uniform(-10, 10), distance])
    return Camera(width, height, scale * distance, rotation, place - rotation @ target)
