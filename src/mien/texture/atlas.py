"""The surface laid out by the mesh's own texture coordinates."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.pyramid import fill_pyramid
from mien.numeric.raster import rasterize
from mien.texture.surface import SurfaceMap, surface_from


def atlas_surface(
    mesh: Mesh, *, width: int = 2048, height: int = 2048, parts: tuple[str, ...] | None = None
) -> SurfaceMap:
    """The surface under every texel of the mesh's own texture coordinates.

    Where charts lie over each other, the first triangle counts.
    Raises: InputError: a mesh without texture coordinates.
    """
    if len(mesh.uv_triangles) == 0:
        raise InputError("mesh", "one with texture coordinates", "one without")
    pixels = mesh.uvs * [width, -height] + [0, height]
    chosen = np.arange(len(mesh.triangles)) if parts is None else mesh.triangles_of(*parts)
    raster = rasterize(pixels, np.ones(len(pixels)), mesh.uv_triangles[chosen], width, height)
    ids = np.append(chosen, -1).astype(np.int32)[raster.triangle_ids]
    return surface_from(mesh, ids, raster.barycentrics)


def fill_gutters(
    pixels: Float[Array, "h w c"], inside: Bool[Array, "h w"], *, rounds: int = 4
) -> Float[Array, "h w c"]:
    """Colours continued beyond the charts, so that filtered lookups at their edges see no seam.

    Args:
        rounds: px around each chart that take the mean of the chart's own nearest pixels; what
            is left further out is smooth and only matters to coarse mip levels.
    """
    import cv2

    filled, known = pixels.astype(np.float32), inside.astype(np.float32)
    kernel = np.ones((3, 3), np.float32)
    for _ in range(rounds):
        count = cv2.filter2D(known, -1, kernel, borderType=cv2.BORDER_CONSTANT)
        grown = (count > 0) & (known == 0)
        sums = cv2.filter2D(filled * known[..., None], -1, kernel, borderType=cv2.BORDER_CONSTANT)
        filled[grown] = sums[grown] / count[grown][:, None]
        known = (count > 0).astype(np.float32)
    result: Array = fill_pyramid(filled, known)
    return result
