"""Colours of a surface, the same from every view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mien.arrays import Array, Float, Int, UInt8
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.images.sampling import sample_bilinear

__all__ = ["Hits", "Paint", "ProjectedPaint", "Projector", "TexturePaint"]


@dataclass(frozen=True)
class Hits:
    """Points on a mesh.

    Attributes:
        triangles: (N,) index of the triangle of each.
        barycentrics: (N, 3) coordinates in it.
    """

    triangles: Int[Array, " n"]
    barycentrics: Float[Array, "n 3"]

    def of(self, corners: Int[Array, "f 3"], values: Float[Array, "v c"]) -> Float[Array, "n c"]:
        """Values at the corners of the triangles, interpolated: (N, C)."""
        return np.einsum("nc,ncd->nd", self.barycentrics, values[corners[self.triangles]])


class Paint(Protocol):
    """Colours of a surface."""

    def __call__(self, mesh: Mesh, hits: Hits) -> Float[Array, "n 3"]:
        """(N, 3) colours from 0 to 255 at these points of the mesh."""
        ...


@dataclass(frozen=True)
class TexturePaint:
    """A texture, by texture coordinates.

    Attributes:
        texture: (H, W, 3) uint8.
        shading: (V,) factor on the colours at each vertex, or None.
    """

    texture: UInt8[Array, "h w 3"]
    shading: Float[Array, " v"] | None = None

    def __call__(self, mesh: Mesh, hits: Hits) -> Float[Array, "n 3"]:
        height, width = self.texture.shape[:2]
        positions = hits.of(mesh.uv_triangles, mesh.uvs) * [width, -height] + [0, height]
        colours = sample_bilinear(self.texture, positions)
        if self.shading is not None:
            colours = colours * hits.of(mesh.triangles, self.shading[:, None])
        return colours


@dataclass(frozen=True)
class Projector:
    """A photo projected back onto the surface that it shows.

    Attributes:
        camera: of the photo.
        photo: (H, W, 3) uint8.
        depth: (H, W, 1) mm of the surface.
        weight: (H, W, 1) blend weight of each pixel.
    """

    camera: Camera
    photo: UInt8[Array, "h w 3"]
    depth: Float[Array, "h w 1"]
    weight: Float[Array, "h w 1"]

    _HIDDEN_MM = 3.0

    def __call__(self, points: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Array]:
        """(N, 3) colours and (N, 1) weights; none where something else is in front."""
        pixels = self.camera.project(points)
        behind = self.camera.to_camera(points)[:, 2:] - sample_bilinear(self.depth, pixels)
        weight = sample_bilinear(self.weight, pixels) * (behind < self._HIDDEN_MM)
        return sample_bilinear(self.photo, pixels), weight


@dataclass(frozen=True)
class ProjectedPaint:
    """Photos projected onto the surface from their cameras, smoothly blended.

    Attributes:
        projectors: one for each photo.
        shadow: (3,) colour of what no photo shows.
    """

    projectors: tuple[Projector, ...]
    shadow: Float[Array, " 3"]

    _FLOOR = 1e-5

    def __call__(self, mesh: Mesh, hits: Hits) -> Float[Array, "n 3"]:
        points = hits.of(mesh.triangles, mesh.vertices)
        total = np.full((len(points), 1), self._FLOOR)
        colours = self._FLOOR * np.broadcast_to(self.shadow, (len(points), 3))
        for projector in self.projectors:
            colour, weight = projector(points)
            colours, total = colours + weight * colour, total + weight
        return colours / total
