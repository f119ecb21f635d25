"""The surface laid out by the mesh's own texture coordinates."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import rasterize
from mien.texture.surface import SurfaceMap, surface_from


def atlas_surface(
    mesh: Mesh, *, width: int = 2048, height: int = 2048, parts: tuple[str, ...] | None = None
) -> SurfaceMap:
    """The surface under every texel of the mesh's own texture coordinates.

    Where charts overlap, the first triangle counts.

    Args:
        mesh: with texture coordinates.
        width: texels.
        height: texels.
        parts: names of the parts to include; all by default.

    Raises:
        InputError: a mesh without texture coordinates.
    """
    if len(mesh.uv_triangles) == 0:
        raise InputError("mesh", "one with texture coordinates", "one without")
    pixels = mesh.uvs * [width, -height] + [0, height]
    chosen = np.arange(len(mesh.triangles)) if parts is None else mesh.triangles_of(*parts)
    raster = rasterize(pixels, np.ones(len(pixels)), mesh.uv_triangles[chosen], width, height)
    ids = np.append(chosen, -1).astype(np.int32)[raster.triangle_ids]
    return surface_from(mesh, ids, raster.barycentrics)


def fill_gutters(pixels: Array, inside: Bool[Array, "h w"]) -> Array:
    """Colours continued beyond the charts, so that filtered lookups at their edges see no seam.

    Every pixel outside takes the colour of the nearest one inside, (H, W, C) of the same type.

    Raises:
        InputError: nothing is inside.
    """
    import cv2

    if not inside.any():
        raise InputError("inside", "at least one pixel", "none")
    _, labels = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros(labels.max() + 1, np.intp)
    nearest[labels[inside]] = np.flatnonzero(inside)
    return pixels.reshape(-1, pixels.shape[2])[nearest[labels]]
