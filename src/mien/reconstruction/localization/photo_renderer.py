"""A head rendered from any side with the colours of photos whose cameras are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.images.sampling import sample_bilinear
from mien.numeric.raster.rasterizer import Raster, interpolate, rasterize

PX_PER_MM = 2.0
"""Of the reduced photos, and the finest that is painted: a head is some 500 px high."""
_SHOWN = ("skin", "left_eyeball", "right_eyeball")
_NEAREST_PHOTOS = 3
"""A picture is painted with the photo taken from nearest by; the next ones fill its gaps. Blending
them costs matches: photos differ in exposure, and cameras and shape are never exact."""
_JUMP_MM, _CLEAR_MM = 6.0, 6.0
"""Depth that changes more from one pixel to the next is an edge. Near one a photo counts less: a
small error of the shape puts there what is behind."""
_BEHIND_MM = 4.0
_MIN_FACING = 0.1
_MIN_WEIGHT = 1e-3
_UNKNOWN_GREY = 110
_FAR_MM = 1e6


@dataclass(frozen=True)
class PhotoRendering:
    """The head as a camera would show it, where the photos show it.

    Attributes:
        grey: (H, W) uint8.
        visible: (H, W) where some photo shows it.
        points: (H, W, 3) mm of the surface behind each pixel, head space; NaN beside the head.
    """

    grey: UInt8[Array, "h w"]
    visible: Bool[Array, "h w"]
    points: Float[Array, "h w 3"]


@dataclass(frozen=True)
class _PreparedPhoto:
    """A reduced photo, its camera, and depth and clearance of edges (0 to 1) by pixel."""

    grey: Float[Array, "h w"]
    camera: Camera
    depth: Float[Array, "h w"]
    clear: Float[Array, "h w"]


class PhotoRenderer:
    """Photos with known cameras, prepared to render the head that they show.

    Attributes:
        mesh: what a photo shows of the head: no hair cap, no lashes, no mouth's inside.
        center: (3,) mm, of the head.
    """

    def __init__(
        self,
        photos: Sequence[tuple[CapturedView, Camera]],
        vertices: Float[Array, "v 3"],
        generic: GenericHead,
    ) -> None:
        whole = generic.mesh.with_vertices(vertices)
        self.mesh = whole.submesh(whole.triangles_of(*_SHOWN))
        self.corners = vertices[np.unique(self.mesh.triangles)]
        self.center: Float[Array, " 3"] = self.corners.mean(axis=0)
        self._normals = self.mesh.vertex_normals()
        self._photos = [_prepared(view, camera, self.mesh) for view, camera in photos]

    def render(self, camera: Camera) -> PhotoRendering:
        """What this camera would see."""
        raster = _rasterized(self.mesh, camera)
        seen = raster.mask
        pixels = np.argwhere(seen)[:, ::-1] + 0.5
        points = np.full((*seen.shape, 3), np.nan)
        points[seen] = camera.unproject(pixels, raster.depth[seen].astype(np.float64))
        normals = interpolate(raster, self.mesh.triangles, self._normals)[seen]
        best, weights = np.zeros((2, len(pixels)), np.float32)
        for photo in self._nearest(camera):
            grey, weight = _sample_photo(photo, points[seen], normals)
            missing = weights <= _MIN_WEIGHT
            best[missing], weights[missing] = grey[missing], weight[missing]
        visible, image = np.zeros(seen.shape, bool), np.full(seen.shape, _UNKNOWN_GREY, np.uint8)
        visible[seen] = sampled = weights > _MIN_WEIGHT
        image[visible] = np.rint(best[sampled])
        return PhotoRendering(image, visible, points)

    def _nearest(self, camera: Camera) -> list[_PreparedPhoto]:
        """The photos taken from nearly the same side."""

        def side(seen_from: Camera) -> Float[Array, " 3"]:
            line = seen_from.center - self.center
            return line / np.linalg.norm(line)

        here = side(camera)
        ordered = sorted(self._photos, key=lambda photo: -float(side(photo.camera) @ here))
        return ordered[:_NEAREST_PHOTOS]


def reduced(pixels: UInt8[Array, "h w 3"], factor: float) -> UInt8[Array, "h w"]:
    """A photo in grey, smaller by this factor (sizes rounded), never larger."""
    import cv2

    grey: Array = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    if factor < 1:
        height, width = (max(1, round(factor * side)) for side in grey.shape)
        grey = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    return grey


def resized_to(camera: Camera, shape: tuple[int, ...]) -> Camera:
    """The same view on an image of this (height, width)."""
    scale = np.array([shape[1] / camera.width, shape[0] / camera.height])
    return replace(
        camera,
        width=shape[1],
        height=shape[0],
        focal_px=camera.focal_px * float(scale.mean()),
        principal_px=camera.principal * scale,
    )


def px_per_mm(camera: Camera) -> float:
    """At the depth of the head's origin."""
    return camera.focal_px / float(camera.t_cam_head[2])


def _rasterized(mesh: Mesh, camera: Camera) -> Raster:
    depth = camera.to_camera(mesh.vertices)[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = camera.project(mesh.vertices)
    return rasterize(pixels, depth, mesh.triangles, camera.width, camera.height)


def _prepared(view: CapturedView, camera: Camera, mesh: Mesh) -> _PreparedPhoto:
    import cv2

    grey = reduced(view.photo.pixels, PX_PER_MM / px_per_mm(camera))
    small = resized_to(camera, grey.shape)
    raster = _rasterized(mesh, small)
    depth = np.where(raster.mask, raster.depth, np.float32(_FAR_MM))
    kernel = np.ones((3, 3), np.uint8)
    smooth = raster.mask & (cv2.dilate(depth, kernel) - cv2.erode(depth, kernel) < _JUMP_MM)
    from_edge = cv2.distanceTransform(smooth.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    clear = np.minimum(from_edge / (_CLEAR_MM * px_per_mm(small)), 1)
    return _PreparedPhoto(grey.astype(np.float32), small, depth, clear)


def _sample_photo(
    photo: _PreparedPhoto, points: Float[Array, "n 3"], normals: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """What a photo shows at points of the surface, and how much that is worth."""
    camera = photo.camera
    depth = camera.to_camera(points)[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = camera.project(points)
    size = np.array([camera.width, camera.height])
    inside = (depth > 0) & ((pixels > 1) & (pixels < size - 1)).all(axis=1)
    pixels[~inside] = 0
    columns, rows = pixels.astype(np.int64).T
    visible = inside & (np.abs(photo.depth[rows, columns] - depth) < _BEHIND_MM)
    towards = camera.center - points
    lengths = np.linalg.norm(towards, axis=1) * np.linalg.norm(normals, axis=1)
    facing = (towards * normals).sum(axis=1) / np.maximum(lengths, 1e-9)
    weight = np.where(visible & (facing > _MIN_FACING), facing**3, 0) * photo.clear[rows, columns]
    return sample_bilinear(photo.grey[..., None], pixels)[:, 0], weight.astype(np.float32)
