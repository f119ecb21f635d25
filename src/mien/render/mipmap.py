"""Mipmaps: texture pyramids and trilinear lookups in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, check_image, frozen
from mien.errors import InputError
from mien.numeric.kernels.jit import njit

# A texel's three channels are weighted by one multiplication: each has 21 of 64 bits, 8 for the
# colour and 13 for the weight.
UNIT = 8192

Four = tuple[np.uint64, ...]
"""Indices of four texels, then their weights in the same order."""


class Pyramids(NamedTuple):
    """Several textures of one size, each with all its levels.

    Attributes:
        texels: (K, N) uint32, red in the lowest byte; level after level, row after row.
        widths: (L,) of each level.
        heights: (L,) of each level.
        starts: (L,) first texel of each level.
    """

    texels: Int[Array, "k n"]
    widths: Int[Array, " l"]
    heights: Int[Array, " l"]
    starts: Int[Array, " l"]


def build_pyramids(textures: Sequence[UInt8[Array, "h w 3"]]) -> Pyramids:
    """Pyramids of textures of one size. Raises: InputError: none, no images, sizes that differ."""
    if not len(textures):
        raise InputError("textures", "at least one", "none")
    rows: list[Array] = []
    sizes: list[tuple[int, int]] = []
    for index, texture in enumerate(textures):
        levels = _halved(check_image(f"texture {index}", texture))
        found = [(level.shape[0], level.shape[1]) for level in levels]
        sizes = sizes or found
        if found != sizes:
            expected = f"{sizes[0][1]}x{sizes[0][0]} px as texture 0 has"
            raise InputError(f"texture {index}", expected, f"{found[0][1]}x{found[0][0]}")
        rows.append(np.concatenate([packed_texels(level) for level in levels]))
    heights, widths = np.array(sizes, np.int64).T.copy()
    starts = np.concatenate([[0], np.cumsum(widths * heights)[:-1]])
    return Pyramids(frozen(np.stack(rows)), frozen(widths), frozen(heights), frozen(starts))


def _halved(texture: Array) -> list[Array]:
    import cv2

    levels = [texture]
    while min(levels[-1].shape[:2]) > 16:
        height, width = levels[-1].shape[0] // 2, levels[-1].shape[1] // 2
        levels.append(cv2.resize(levels[-1], (width, height), interpolation=cv2.INTER_AREA))
    return levels


def packed_texels(level: UInt8[Array, "h w 3"]) -> Int[Array, " n"]:
    """(h * w,) uint32, red lowest, row after row."""
    import cv2

    packed: Array = cv2.cvtColor(np.ascontiguousarray(level), cv2.COLOR_RGB2RGBA)
    return packed.view(np.uint32).ravel()


def texel_areas(uvs: Float[Array, "f 3 2"], pyramids: Pyramids) -> Float[Array, " f"]:
    """(F,) areas of triangles with these corners in texels of the finest level."""
    corners = uvs * [pyramids.widths[0], pyramids.heights[0]]
    b, c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]) / 2


def level_of_detail(
    texels: Float[Array, " f"], points: Float[Array, "v 2"], triangles: Int[Array, "f 3"]
) -> Float[Array, " v"]:
    """(V,) log2 of the texels along a sample's side, from the areas of the triangles around.

    Args:
        texels: (F,) of texel_areas.
        points: (V, 2) in samples.
        triangles: (F, 3) vertex indices.
    """
    detail = np.empty(len(points), np.float32)
    _level_of_detail(texels, points, triangles, detail)
    return detail


@njit(cache=True, nogil=True, error_model="numpy")
def _level_of_detail(texels: Array, points: Array, triangles: Array, detail: Array) -> None:
    # Sums over the triangles around a vertex: it changes smoothly over the head.
    sums = np.full((len(points), 2), 1e-9)
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        bx, by = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        cx, cy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
        area = abs(bx * cy - by * cx) / 2.0
        for corner in range(3):
            sums[triangles[t, corner], 0] += texels[t]
            if area < np.inf:
                sums[triangles[t, corner], 1] += area
    for v in range(len(points)):
        detail[v] = 0.5 * np.log2(sums[v, 0] / sums[v, 1])


@njit(inline="always")
def place_lookup(pyramids: Pyramids, u: float, v: float, level: float) -> tuple[Four, Four]:
    """Texels and weights of the colour at (u, v), the same in every texture.

    Trilinear: bilinear in the two levels nearest to one texel a sample. u is periodic; v points up
    and is clamped.

    Returns:
        four in the finer and four in the coarser level.
    """
    last = len(pyramids.starts) - 1
    level = min(max(level, 0.0), float(last))
    fine = int(level)
    coarse_share = int((level - fine) * UNIT + 0.5)
    return (
        _place_in_level(pyramids, fine, u, v, UNIT - coarse_share),
        _place_in_level(pyramids, min(fine + 1, last), u, v, coarse_share),
    )


@njit(inline="always")
def _place_in_level(pyramids: Pyramids, level: int, u: float, v: float, share: int) -> Four:
    width, height = pyramids.widths[level], pyramids.heights[level]
    start = pyramids.starts[level]
    x = (u - np.floor(u)) * width - 0.5
    y = min(max((1.0 - v) * height - 0.5, 0.0), height - 1.0)
    x0, y0 = int(np.floor(x)), int(y)
    left = x0 if x0 >= 0 else width - 1
    right = x0 + 1 if x0 + 1 < width else 0
    above, below = start + y0 * width, start + min(y0 + 1, height - 1) * width
    # Rounded so that they sum to the share: a texture of one colour keeps it.
    lower = int(share * (y - y0) + 0.5)
    upper_right = int((share - lower) * (x - x0) + 0.5)
    lower_right = int(lower * (x - x0) + 0.5)
    return (
        np.uint64(above + left),
        np.uint64(above + right),
        np.uint64(below + left),
        np.uint64(below + right),
        np.uint64(share - lower - upper_right),
        np.uint64(upper_right),
        np.uint64(lower - lower_right),
        np.uint64(lower_right),
    )


@njit(inline="always")
def weighted_texels(
    texels: Array, texture: int, fine: Four, coarse: Four
) -> tuple[float, float, float]:
    """One texture's colour, from 0 to 255."""
    total = spread_texel(texels[texture, fine[0]]) * fine[4]
    total += spread_texel(texels[texture, fine[1]]) * fine[5]
    total += spread_texel(texels[texture, fine[2]]) * fine[6]
    total += spread_texel(texels[texture, fine[3]]) * fine[7]
    total += spread_texel(texels[texture, coarse[0]]) * coarse[4]
    total += spread_texel(texels[texture, coarse[1]]) * coarse[5]
    total += spread_texel(texels[texture, coarse[2]]) * coarse[6]
    total += spread_texel(texels[texture, coarse[3]]) * coarse[7]
    lane = np.uint64(0x1FFFFF)
    red = np.int64(total & lane)
    green = np.int64((total >> np.uint64(21)) & lane)
    blue = np.int64(total >> np.uint64(42))
    return red / UNIT, green / UNIT, blue / UNIT


@njit(inline="always")
def spread_texel(texel: np.uint32) -> np.uint64:
    """Every channel in the lowest 8 of 21 bits."""
    wide = np.uint64(texel)
    green, blue = wide & np.uint64(0xFF00), wide & np.uint64(0xFF0000)
    return (wide & np.uint64(0xFF)) | (green << np.uint64(13)) | (blue << np.uint64(26))
