"""The photos cut to the head and brought to one scale, ready to be matched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import Raster, rasterize

_MARGIN = 0.08
"""Space around the head, as a share of its size in the photo."""
_MIN_SIDE = 32
_HIDING = ("skin", "left_eyeball", "right_eyeball")


@dataclass(frozen=True)
class Crop:
    """A photo's part that shows the head, reduced.

    Attributes:
        grey: (H, W) float32, 0 to 255.
        camera: of this image.
        scale: (2,) its px over the photo's, along x and y: whole pixels make them differ a little.
        corner: (2,) px of the photo at its origin.
        raster: the head as the camera sees it.
    """

    grey: Float[Array, "h w"]
    camera: Camera
    scale: Float[Array, " 2"]
    corner: Float[Array, " 2"]
    raster: Raster

    def to_photo(self, points: Float[Array, "n 2"]) -> Float[Array, "n 2"]:
        """Px of this image to px of the photo."""
        return points / self.scale + self.corner


def visible_mesh(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Mesh:
    """The parts that a photo shows and that hide what is behind them: no hair cap, no lashes."""
    return generic.mesh.with_vertices(vertices).submesh(generic.mesh.triangles_of(*_HIDING))


def finest_mm_per_px(cameras: Sequence[Camera]) -> float:
    """How many mm a pixel of the photo of the highest resolution shows."""
    return min(float(camera.t_cam_head[2]) / camera.focal_px for camera in cameras)


def crop_view(view: CapturedView, camera: Camera, mesh: Mesh, mm_per_px: float) -> Crop | None:
    """The part of a photo that shows the mesh, reduced so that a pixel shows mm_per_px.

    None where the camera sees next to nothing of the mesh.
    """
    import cv2

    photo = view.photo.pixels
    used = np.unique(mesh.triangles)
    if (camera.to_camera(mesh.vertices[used])[:, 2] <= 0).any():
        return None
    pixels = camera.project(mesh.vertices[used])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = _MARGIN * (high - low)
    limit = np.array([camera.width, camera.height])
    first = np.clip(np.floor(low - margin), 0, limit).astype(int)
    end = np.clip(np.ceil(high + margin), 0, limit).astype(int)
    scale = min(1.0, float(camera.t_cam_head[2]) / camera.focal_px / mm_per_px)
    size = np.maximum((end - first) * scale, 1).round().astype(int)
    if size.min() < _MIN_SIDE:
        return None
    grey = cv2.cvtColor(photo[first[1] : end[1], first[0] : end[0]], cv2.COLOR_RGB2GRAY)
    grey = cv2.resize(grey, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA)
    small = replace(
        camera,
        width=int(size[0]),
        height=int(size[1]),
        focal_px=camera.focal_px * scale,
        principal_px=(camera.principal - first) * scale,
    )
    # Whole pixels stretch the image a little: the surface has to lie where the image shows it.
    exact = size / (end - first)
    raster = rasterize(
        (camera.project(mesh.vertices) - first) * exact,
        small.to_camera(mesh.vertices)[:, 2],
        mesh.triangles,
        small.width,
        small.height,
    )
    return Crop(grey.astype(np.float32), small, exact, first.astype(float), raster)
