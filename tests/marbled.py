"""A person with marbled skin, known exactly, photographed in front of clutter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.faces.landmarks import Landmarks
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.numeric.raster.rasterizer import interpolate, rasterize
from people import camera

GENERIC = load_generic_head()
SHOWN = GENERIC.mesh.submesh(GENERIC.mesh.triangles_of("skin", "left_eyeball", "right_eyeball"))
SIZE, PX_PER_MM = (384, 448), 1.28
_LATTICE, _CELL_MM = 96, 4.0


@cache
def marble(seed: int) -> Array:
    """A lattice of random greys, smooth over a cell: the skin is cut out of it."""
    greys = gaussian_filter(np.random.default_rng(seed).normal(size=(_LATTICE,) * 3), 0.8)
    return np.asarray(128 + 40 * greys / np.abs(greys).std(), np.float32)


@dataclass(frozen=True)
class Person:
    """A shape, (V, 3) mm, and the seed of a skin."""

    vertices: Array
    skin: int

    def seen_by(self, seen_from: Camera, *, name: str = "photo.png") -> CapturedView:
        """A photo of this person: neither marks nor landmarks."""
        depth = seen_from.to_camera(self.vertices)[:, 2]
        pixels = seen_from.project(self.vertices)
        raster = rasterize(pixels, depth, SHOWN.triangles, seen_from.width, seen_from.height)
        # Cut at the generic head's places, so that the skin follows when the shape changes.
        places = interpolate(raster, SHOWN.triangles, GENERIC.mesh.vertices)[raster.mask]
        greys = clutter(seen_from.height, seen_from.width, self.skin)
        lattice = places.T / _CELL_MM + _LATTICE / 2
        greys[raster.mask] = map_coordinates(marble(self.skin), lattice, order=1, mode="wrap")
        image = np.clip(np.rint(greys), 0, 255).astype(np.uint8)
        photo = Photo(name, Path(name), np.repeat(image[..., None], 3, axis=2))
        return CapturedView(photo, None, None)


def clutter(height: int, width: int, seed: int) -> Array:
    """(H, W) of blobs."""
    noise = gaussian_filter(np.random.default_rng(1000 + seed).normal(size=(height, width)), 3)
    return np.asarray(120 + 30 * noise / noise.std(), np.float32)


def at(yaw: float, pitch: float = 0.0, roll: float = 0.0, *, distance: float = 900.0) -> Camera:
    """A camera before the face whose photo the whole head fits into."""
    seen_from = camera(yaw, pitch, roll, distance=distance)
    target = np.array([0.0, -20.0, -60.0])
    shift = np.array([0.0, 0.0, distance]) - seen_from.R_cam_head @ target
    return Camera(*SIZE, PX_PER_MM * distance, seen_from.R_cam_head, shift)


def photographed(who: Person, yaws: tuple[float, ...]) -> list[tuple[CapturedView, Camera]]:
    """Photos from these sides with their cameras."""
    cameras = [at(yaw, 4 * (-1) ** k) for k, yaw in enumerate(yaws)]
    return [(who.seen_by(item, name=f"{k}.png"), item) for k, item in enumerate(cameras)]


def detected(
    view: CapturedView, seen_from: Camera, vertices: Array, *, off_mm: float = 2.0
) -> CapturedView:
    """The photo with landmarks that lie off by so much."""
    rng = np.random.default_rng(abs(int(seen_from.center[0])))
    points = seen_from.project(GENERIC.landmark_positions(vertices))
    points = points + off_mm * PX_PER_MM * rng.normal(size=points.shape)
    landmarks = Landmarks(points, np.ones(478), np.zeros(52), seen_from.R_cam_head)
    return replace(view, landmarks=landmarks)
