"""The piece of a head's surface that each pixel of a texture stands for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.raster import Raster, interpolate


@dataclass(frozen=True)
class SurfaceMap:
    """A texture's pixels (texels) on the surface. Row 0 is the top, v = 1.

    Attributes:
        points: (H, W, 3) float32 mm, head space; zero where there is no surface.
        normals: (H, W, 3) float32, unit, outward.
        triangle_ids: (H, W) int32 into the mesh's triangles, -1 where there is no surface.
        barycentrics: (H, W, 3) float32.
        wrap: the left and right ends touch, as on a cylinder.
    """

    points: Float[Array, "h w 3"]
    normals: Float[Array, "h w 3"]
    triangle_ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    wrap: bool = False

    @property
    def mask(self) -> Bool[Array, "h w"]:
        """(H, W) bool: where there is a surface."""
        inside: Array = self.triangle_ids >= 0
        return inside

    @cached_property
    def texel_mm(self) -> float:
        """How far apart neighbouring texels lie on the surface: the median over both directions."""
        steps = []
        for axis in (0, 1):
            there, here = np.diff(self.points, axis=axis), np.diff(self.triangle_ids, axis=axis)
            inside = np.minimum(*_neighbours(self.triangle_ids, axis)) >= 0
            # Texels of one triangle: across others there may be a fold or a seam between.
            steps.append(np.linalg.norm(there[inside & (here == 0)], axis=1))
        lengths = np.concatenate(steps)
        if not len(lengths):
            raise InputError("surface", "neighbouring texels on one triangle", "none")
        return float(np.median(lengths))


def surface_from(
    mesh: Mesh,
    triangle_ids: Int[Array, "h w"],
    barycentrics: Float[Array, "h w 3"],
    *,
    wrap: bool = False,
) -> SurfaceMap:
    """The surface under texels whose triangles and places in them are known."""
    raster = Raster(triangle_ids, barycentrics, np.empty((0, 0), np.float32))
    points = interpolate(raster, mesh.triangles, mesh.vertices)
    normals = interpolate(raster, mesh.triangles, mesh.vertex_normals())
    lengths = np.sqrt(np.einsum("hwc,hwc->hw", normals, normals))
    normals /= np.maximum(lengths, 1e-12)[..., None]
    return SurfaceMap(points, normals, triangle_ids, barycentrics, wrap)


def parts_of(surface: SurfaceMap, mesh: Mesh, *names: str) -> Bool[Array, "h w"]:
    """(H, W) bool: texels on the named parts; parts that the mesh has not are left out."""
    wanted = [mesh.part_names.index(name) for name in names if name in mesh.part_names]
    chosen = np.append(np.isin(mesh.part, wanted), False)
    texels: Array = chosen[surface.triangle_ids]  # -1 picks the False at the end.
    return texels


def restricted(surface: SurfaceMap, keep: Bool[Array, "h w"]) -> SurfaceMap:
    """The same surface with only the texels to keep."""
    ids = np.where(keep, surface.triangle_ids, -1).astype(np.int32)
    return SurfaceMap(surface.points, surface.normals, ids, surface.barycentrics, surface.wrap)


def cropped(surface: SurfaceMap, box: tuple[slice, slice]) -> SurfaceMap:
    """The rectangle of texels in the given rows and columns."""
    return SurfaceMap(
        surface.points[box],
        surface.normals[box],
        surface.triangle_ids[box],
        surface.barycentrics[box],
        surface.wrap,
    )


def mirrored(surface: SurfaceMap, mesh: Mesh, mirror: Int[Array, " v"]) -> SurfaceMap:
    """For every texel the place on the other side of the head that looks like it.

    Args:
        mirror: (V,) index of each vertex's left-right partner.
    Raises: InputError: a mirror map of another mesh.

    Normals are those of the other side too, so that visibility and certainty are judged there.
    """
    if np.shape(mirror) != (len(mesh.vertices),):
        raise InputError("mirror", f"{len(mesh.vertices)} indices", f"shape {np.shape(mirror)}")
    mirror = np.asarray(mirror)
    raster = Raster(surface.triangle_ids, surface.barycentrics, np.empty((0, 0), np.float32))
    points = interpolate(raster, mesh.triangles, mesh.vertices[mirror])
    normals = interpolate(raster, mesh.triangles, mesh.vertex_normals()[mirror])
    lengths = np.sqrt(np.einsum("hwc,hwc->hw", normals, normals))
    normals /= np.maximum(lengths, 1e-12)[..., None]
    return SurfaceMap(points, normals, surface.triangle_ids, surface.barycentrics, surface.wrap)


def _neighbours(array: Array, axis: int) -> tuple[Array, Array]:
    if axis == 0:
        return array[:-1], array[1:]
    return array[:, :-1], array[:, 1:]
