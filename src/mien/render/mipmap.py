"""Textures looked up through a pyramid, so that what is seen small does not flicker."""

from __future__ import annotations

import numpy as np
from numba import njit

from mien.arrays import Array, Float, UInt8, frozen
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.raster import Raster
from mien.numeric.threads import for_row_bands


def sample_texture(
    mesh: Mesh,
    vertices_px: Float[Array, "v 2"],
    raster: Raster,
    texture: UInt8[Array, "h w 3"],
) -> Float[Array, "h w 3"]:
    """The texture's colours on every pixel, (H, W, 3) float32 from 0 to 255.

    Trilinear: bilinear in the two levels of the texture's pyramid that come nearest to one texel
    a pixel. u goes around, v ends at the image's edge.
    Raises: InputError: a mesh without texture coordinates.
    """
    if len(mesh.uv_triangles) == 0:
        raise InputError("mesh", "one with texture coordinates", "one without")
    levels = _pyramid(texture)
    flat = np.concatenate([level.reshape(-1, 3) for level in levels])
    sizes = np.array([level.shape[:2] for level in levels], np.int64)
    starts = np.cumsum([0, *(level.shape[0] * level.shape[1] for level in levels[:-1])])
    detail = _level_of_detail(mesh, vertices_px, texture.shape[1], texture.shape[0])
    arrays = (
        raster.triangle_ids,
        raster.barycentrics,
        mesh.triangles,
        mesh.uv_triangles,
        mesh.uvs,
        detail,
        flat,
        sizes,
        starts,
    )
    inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]
    height, width = raster.triangle_ids.shape
    out = np.zeros((height, width, 3), np.float32)
    for_row_bands(lambda a, b: _texture_rows(*inputs, a, b, out), height, work=width * height)
    return out


def _pyramid(texture: Array) -> list[Array]:
    import cv2

    levels = [texture]
    while min(levels[-1].shape[:2]) > 16:
        height, width = levels[-1].shape[0] // 2, levels[-1].shape[1] // 2
        levels.append(cv2.resize(levels[-1], (width, height), interpolation=cv2.INTER_AREA))
    return levels


def _level_of_detail(mesh: Mesh, vertices_px: Array, width: int, height: int) -> Float[Array, " v"]:
    """(V,) float32: log2 of the texels along a pixel's side, from the areas of the triangles."""
    texels = _areas(mesh.uvs * [width, height], mesh.uv_triangles)
    pixels = _areas(np.nan_to_num(vertices_px), mesh.triangles)
    # Sums over the triangles around a vertex: it changes smoothly over the head.
    corners = mesh.triangles.ravel()
    count = len(mesh.vertices)
    texels, pixels = (
        np.bincount(corners, np.repeat(area, 3), minlength=count) for area in (texels, pixels)
    )
    ratio = np.maximum(texels, 1e-9) / np.maximum(pixels, 1e-9)
    detail: Array = (0.5 * np.log2(ratio)).astype(np.float32)
    return detail


def _areas(points: Array, triangles: Array) -> Float[Array, " f"]:
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    cross: Array = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.abs(cross) / 2


@njit(cache=True, nogil=True)
def _add_level(
    flat: Array, start: int, width: int, height: int, u: float, v: float, share: float, out: Array
) -> None:
    """Add share x one level's colour at (u, v) to out; v points down here, u goes around."""
    x, y = u * width - 0.5, min(max(v * height - 0.5, 0.0), height - 1.0)
    x0, y0 = int(np.floor(x)), int(y)
    fx, fy = x - x0, y - y0
    left, right = x0 % width, (x0 + 1) % width
    above, below = start + y0 * width, start + min(y0 + 1, height - 1) * width
    w00, w01 = share * (1.0 - fy) * (1.0 - fx), share * (1.0 - fy) * fx
    w10, w11 = share * fy * (1.0 - fx), share * fy * fx
    for c in range(3):
        upper = w00 * flat[above + left, c] + w01 * flat[above + right, c]
        out[c] += upper + w10 * flat[below + left, c] + w11 * flat[below + right, c]


@njit(cache=True, nogil=True)
def _texture_rows(
    ids: Array,
    barycentrics: Array,
    triangles: Array,
    uv_triangles: Array,
    uvs: Array,
    detail: Array,
    flat: Array,
    sizes: Array,
    starts: Array,
    first: int,
    end: int,
    out: Array,
) -> None:
    last = len(starts) - 1
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0:
                continue
            u, v, level = 0.0, 0.0, 0.0
            for corner in range(3):
                share = barycentrics[row, col, corner]
                u += share * uvs[uv_triangles[t, corner], 0]
                v += share * (1.0 - uvs[uv_triangles[t, corner], 1])
                level += share * detail[triangles[t, corner]]
            level = min(max(level, 0.0), float(last))
            fine = int(level)
            coarse, share = min(fine + 1, last), level - fine
            pixel = out[row, col]
            width, height = sizes[fine, 1], sizes[fine, 0]
            _add_level(flat, starts[fine], width, height, u, v, 1.0 - share, pixel)
            if share > 0.0:
                width, height = sizes[coarse, 1], sizes[coarse, 0]
                _add_level(flat, starts[coarse], width, height, u, v, share, pixel)
