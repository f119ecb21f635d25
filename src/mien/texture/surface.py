"""The point on a head's surface for each pixel of a texture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import Raster, interpolate


@dataclass(frozen=True)
class SurfaceMap:
    """A texture's pixels (texels) on the surface. Row 0 is the top, v = 1.

    Attributes:
        points: (H, W, 3) float32 mm, head space; zero where there is no surface.
        normals: (H, W, 3) float32, unit, outward.
        triangle_ids: (H, W) int32 into the mesh's triangles, -1 where there is no surface.
        barycentrics: (H, W, 3) float32.
        texel_mm: median distance of neighbouring texels on the surface.
        wrap: the left and right ends touch, as on a cylinder.
    """

    points: Float[Array, "h w 3"]
    normals: Float[Array, "h w 3"]
    triangle_ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    texel_mm: float
    wrap: bool = False

    @property
    def mask(self) -> Bool[Array, "h w"]:
        """(H, W) bool: where there is a surface."""
        return self.triangle_ids >= 0


def surface_from(
    mesh: Mesh,
    triangle_ids: Int[Array, "h w"],
    barycentrics: Float[Array, "h w 3"],
    *,
    wrap: bool = False,
) -> SurfaceMap:
    """The surface map from the triangle and the barycentrics of every texel.

    Raises:
        InputError: no two neighbouring texels.
    """
    points, normals = _points_and_normals(mesh, triangle_ids, barycentrics, np.s_[:])
    texel_mm = _texel_mm(points, triangle_ids)
    return SurfaceMap(points, normals, triangle_ids, barycentrics, texel_mm, wrap)


def interpolate_vertex_values(
    surface: SurfaceMap, mesh: Mesh, values: Float[Array, "v c"]
) -> Float[Array, "h w c"]:
    """Values at the mesh's vertices, interpolated over the texels; 0 where there is no surface."""
    raster = Raster(surface.triangle_ids, surface.barycentrics, np.empty((0, 0), np.float32))
    return interpolate(raster, mesh.triangles, values)


def part_mask(surface: SurfaceMap, mesh: Mesh, *names: str) -> Bool[Array, "h w"]:
    """(H, W) bool: texels on the named parts; parts that the mesh has not are left out."""
    wanted = [mesh.part_names.index(name) for name in names if name in mesh.part_names]
    chosen = np.append(np.isin(mesh.part, wanted), False)
    texels: Array = chosen[surface.triangle_ids]  # -1 picks the False at the end.
    return texels


def restricted(surface: SurfaceMap, keep: Bool[Array, "h w"]) -> SurfaceMap:
    """The same surface with only the texels to keep."""
    ids = np.where(keep, surface.triangle_ids, -1).astype(np.int32)
    return replace(surface, triangle_ids=ids)


def cropped(surface: SurfaceMap, box: tuple[slice, slice]) -> SurfaceMap:
    """The rectangle of texels in the given rows and columns."""
    return replace(
        surface,
        points=np.ascontiguousarray(surface.points[box]),
        normals=np.ascontiguousarray(surface.normals[box]),
        triangle_ids=np.ascontiguousarray(surface.triangle_ids[box]),
        barycentrics=np.ascontiguousarray(surface.barycentrics[box]),
    )


def mirrored(surface: SurfaceMap, mesh: Mesh, mirror: Int[Array, " v"]) -> SurfaceMap:
    """The surface map with every texel at its mirror point on the other side of the head.

    Args:
        surface: to be mirrored; normals are mirrored too, so that visibility is computed there.
        mesh: the surface's.
        mirror: (V,) index of each vertex's left-right partner.

    Raises:
        InputError: a mirror map of another mesh.
    """
    if np.shape(mirror) != (len(mesh.vertices),):
        raise InputError("mirror", f"{len(mesh.vertices)} indices", f"shape {np.shape(mirror)}")
    points, normals = _points_and_normals(
        mesh, surface.triangle_ids, surface.barycentrics, np.asarray(mirror)
    )
    return replace(surface, points=points, normals=normals)


def _points_and_normals(
    mesh: Mesh, triangle_ids: Array, barycentrics: Array, vertices: Array | slice
) -> tuple[Array, Array]:
    """Interpolated over the texels, with each vertex replaced by the given one."""
    raster = Raster(triangle_ids, barycentrics, np.empty((0, 0), np.float32))
    points = interpolate(raster, mesh.triangles, mesh.vertices[vertices])
    normals = interpolate(raster, mesh.triangles, mesh.vertex_normals()[vertices])
    lengths = np.sqrt(np.einsum("hwc,hwc->hw", normals, normals))
    normals /= np.maximum(lengths, 1e-12)[..., None]
    return points, normals


def _texel_mm(points: Array, triangle_ids: Array) -> float:
    steps = []
    for near, far in ((np.s_[::3, :-1], np.s_[::3, 1:]), (np.s_[:-1, ::3], np.s_[1:, ::3])):
        inside = (triangle_ids[near] >= 0) & (triangle_ids[far] >= 0)
        steps.append(np.linalg.norm(points[far][inside] - points[near][inside], axis=1))
    lengths = np.concatenate(steps)
    if not len(lengths):
        raise InputError("surface", "neighbouring texels", "none")
    return float(np.median(lengths))
