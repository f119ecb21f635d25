"""Textures looked up through a pyramid, so that what is seen small does not flicker."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int, UInt8, check_image, frozen
from mien.errors import InputError

# A texel's three channels are weighted by one multiplication: each has 21 of 64 bits to itself, 8
# for the colour and 13 for the weight.
UNIT = 8192


class Pyramids(NamedTuple):
    """Several textures of one size, each with all its levels.

    Attributes:
        texels: (K, N) uint32, red in the lowest byte; level after level, row after row.
        widths, heights, starts: (L,) each level's size and its first texel.
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
        rows.append(np.concatenate([_packed(level) for level in levels]))
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


def _packed(level: Array) -> Int[Array, " n"]:
    import cv2

    packed: Array = cv2.cvtColor(np.ascontiguousarray(level), cv2.COLOR_RGB2RGBA)
    return packed.view(np.uint32).ravel()


def texel_areas(uvs: Float[Array, "f 3 2"], pyramids: Pyramids) -> Float[Array, " f"]:
    """(F,) how many texels of the finest level the triangles with these corners cover."""
    corners = uvs * [pyramids.widths[0], pyramids.heights[0]]
    b, c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas: Array = np.abs(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]) / 2
    return areas


def level_of_detail(
    texels: Float[Array, " f"], points: Float[Array, "v 2"], triangles: Int[Array, "f 3"]
) -> Float[Array, " v"]:
    """(V,) log2 of the texels along a sample's side, from the areas of the triangles around.

    Args:
        texels: (F,) of texel_areas. points: (V, 2) samples' widths.
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


@njit(cache=True, nogil=True, error_model="numpy")
def place_lookup(
    pyramids: Pyramids, u: float, v: float, level: float, places: Array, weights: Array
) -> int:
    """Which texels make the colour at (u, v), the same ones in every texture.

    Trilinear: bilinear in the two levels that come nearest to one texel a sample. u goes around,
    v points up and ends at the image's edge.

    Args:
        places: (8,) int64 to fill. weights: (8,) uint64 to fill: shares of UNIT.
    Returns: how many there are, 4 or 8.
    """
    last = len(pyramids.starts) - 1
    level = min(max(level, 0.0), float(last))
    fine = int(level)
    coarse_share = int((level - fine) * UNIT + 0.5)
    _place_in_level(pyramids, fine, u, v, UNIT - coarse_share, places, weights, 0)
    if coarse_share == 0:
        return 4
    _place_in_level(pyramids, fine + 1, u, v, coarse_share, places, weights, 4)
    return 8


@njit(cache=True, nogil=True, error_model="numpy")
def _place_in_level(
    pyramids: Pyramids,
    level: int,
    u: float,
    v: float,
    share: int,
    places: Array,
    weights: Array,
    first: int,
) -> None:
    width, height = pyramids.widths[level], pyramids.heights[level]
    start = pyramids.starts[level]
    x = (u - np.floor(u)) * width - 0.5
    y = min(max((1.0 - v) * height - 0.5, 0.0), height - 1.0)
    x0, y0 = int(np.floor(x)), int(y)
    left = x0 if x0 >= 0 else width - 1
    right = x0 + 1 if x0 + 1 < width else 0
    above, below = start + y0 * width, start + min(y0 + 1, height - 1) * width
    places[first], places[first + 1] = above + left, above + right
    places[first + 2], places[first + 3] = below + left, below + right
    # Rounded so that they sum to the share: a plain texture keeps its colour.
    lower = int(share * (y - y0) + 0.5)
    upper_right = int((share - lower) * (x - x0) + 0.5)
    lower_right = int(lower * (x - x0) + 0.5)
    weights[first], weights[first + 1] = share - lower - upper_right, upper_right
    weights[first + 2], weights[first + 3] = lower - lower_right, lower_right


@njit(cache=True, nogil=True, error_model="numpy")
def weighted_texels(
    texels: Array, texture: int, places: Array, weights: Array, count: int
) -> tuple[float, float, float]:
    """One texture's colour, from 0 to 255."""
    total = np.uint64(0)
    for n in range(count):
        texel = np.uint64(texels[texture, places[n]])
        spread = (
            (texel & np.uint64(0xFF))
            | ((texel & np.uint64(0xFF00)) << np.uint64(13))
            | ((texel & np.uint64(0xFF0000)) << np.uint64(26))
        )
        total += weights[n] * spread
    lane = np.uint64(0x1FFFFF)
    red = np.int64(total & lane)
    green = np.int64((total >> np.uint64(21)) & lane)
    blue = np.int64(total >> np.uint64(42))
    return red / UNIT, green / UNIT, blue / UNIT
