"""The loops behind `Composer`: one pass over the rows of a picture, without an image-sized buffer.

A row is cut where the set of subregions changes. Along such a piece the same examples contribute,
and within a triangle positions in all photos change by constant steps: each part of the work is a
plain loop over arrays of numbers, which the compiler turns into vector instructions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.prefetch import prefetch
from mien.numeric.raster.piecewise_affine import SUBPIXELS, row_extents, scanline_spans
from mien.synthesis.composition.blend_weights import WEIGHT_UNIT, BlendWeights

__all__ = ["SUBTEXELS", "Mixtures", "Photos", "draw_rows"]

SUBTEXELS = 256
"""Positions between texels are rounded to so many parts of their distance."""

_CHUNK = 64
"""Pixels of a row that are processed together."""

_LANES = 16
"""Chunks are processed in whole vectors; results beyond the end of a chunk are not written."""

_Float, _UInt, _Index = np.float32, np.uint32, np.uint64
"""Unsigned: indices that may be negative prevent vector instructions."""

_PREFETCH_ROWS = _Index(4)
"""How many rows ahead of their use texels are requested from memory."""

# One buffer with rows at constant offsets: for separate arrays the compiler would have to check
# again and again that they do not overlap.
_PITCH = _Index(_CHUNK + _LANES)
_INDEX, _X, _Y, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT, _LOWER_RIGHT = (
    _Index(row) * _PITCH for row in range(7)
)
_RED, _GREEN, _BLUE, _WEIGHT, _REST = (_Index(row) * _PITCH for row in range(5))


class Photos(NamedTuple):
    """All examples' photos, one after another.

    Attributes:
        texels: (N,) uint32, red lowest.
        starts: (m,) where each photo begins in `texels`.
        widths: (m,) px.
        heights: (m,) px.
    """

    texels: Int[Array, " n"]
    starts: Int[Array, " m"]
    widths: Int[Array, " m"]
    heights: Int[Array, " m"]


class Mixtures(NamedTuple):
    """The coefficients of the examples.

    Attributes:
        coefficients: (R + 1, m) float32, of each region, divided by SUBTEXELS.
        starts: (S + 1,) where the examples of each set of regions begin in `used`.
        used: indices of the examples that contribute to a set, set after set.
    """

    coefficients: Float[Array, "r+1 m"]
    starts: Int[Array, " s+1"]
    used: Int[Array, " k"]


@njit(cache=True, nogil=True, error_model="numpy")
def draw_rows(
    corners: Array,
    triangles: Array,
    maps: Array,
    photos: Photos,
    standard: int,
    blend: BlendWeights,
    mixtures: Mixtures,
    first: int,
    end: int,
    out: Array,
) -> None:
    """Draw the pixels of some rows that the triangles cover.

    Args:
        corners: as for `mien.numeric.raster.piecewise_affine`.
        triangles: as for `mien.numeric.raster.piecewise_affine`.
        maps: as for `mien.numeric.raster.piecewise_affine`.
        photos: of the examples.
        standard: index of the photo that is the standard image.
        blend: weights of the regions in the standard image.
        mixtures: of the examples in each region.
        first: row.
        end: row after the last one.
        out: (h, w, 3) uint8.
    """
    # Unpacked: access to arrays in tuples is slow.
    texels, photo_starts, widths, heights = photos
    coefficients, used_starts, used = mixtures
    width = out.shape[1]
    pixels = out.reshape(-1)
    memory = np.zeros(7 * _PITCH, np.uint32)
    weights = np.zeros(len(widths) * _PITCH, np.float32)
    sums = np.zeros(5 * _PITCH, np.float32)
    tops, ends = row_extents(corners, triangles)
    cuts = np.empty((len(triangles), 3), np.int64)
    starts = np.empty(2 * len(triangles) + 2, np.int64)
    spans = np.empty(2 * len(triangles) + 1, np.int64)
    for row in range(first, end):
        count = scanline_spans(corners, triangles, tops, ends, row, width, cuts, starts, spans)
        n, col = 0, 0
        while col < width:
            if spans[n] < 0:
                col, n = starts[n + 1], n + 1
                continue
            here = (maps, corners, triangles, row, col, starts, spans, n)
            most = min(width - col, _CHUNK)
            most = _locate(here, standard, blend.width, blend.height, most, memory)
            code = blend.codes[_Index(memory[_INDEX])]
            size = _run_length(blend.codes, code, memory, most)
            first_used, end_used = used_starts[code], used_starts[code + 1]
            _example_weights(
                blend, code, coefficients, used, first_used, end_used, size, memory, sums, weights
            )
            sums[:] = _Float(0.5)
            for u in range(first_used, end_used):
                i = used[u]
                _locate(here, i, widths[i], heights[i], size, memory)
                _gather(texels, photo_starts[i], widths[i], size, memory)
                _accumulate(memory, weights, u - first_used, size, sums)
            _store(sums, pixels, 3 * (row * width + col), size)
            col += size
            while n < count and starts[n + 1] <= col:
                n += 1


@njit(inline="always")
def _padded(count: int) -> np.uint64:
    """Rounded up to whole vectors."""
    return _Index(count + _LANES - 1) & ~_Index(_LANES - 1)


@njit(inline="always")
def _locate(here: tuple, picture: int, width: int, height: int, most: int, memory: Array) -> int:
    """Fill in the positions of pixels in a picture; return how many come before the mesh ends."""
    maps, corners, triangles, row, col, starts, spans, n = here
    done = 0
    while done < most and spans[n] >= 0:
        t = spans[n]
        home = triangles[t, 0]
        right = col + done - corners[home, 0] // SUBPIXELS
        down = row - corners[home, 1] // SUBPIXELS
        x = maps[t, picture, 0] + maps[t, picture, 1] * right + maps[t, picture, 2] * down
        y = maps[t, picture, 3] + maps[t, picture, 4] * right + maps[t, picture, 5] * down
        count = min(starts[n + 1] - col, most) - done
        _texel_positions(
            x, maps[t, picture, 1], y, maps[t, picture, 4], width, height, done, count, memory
        )
        done += count
        n += 1
    return done


@njit(cache=True, nogil=True, error_model="numpy")
def _texel_positions(
    x0: float,
    dx: float,
    y0: float,
    dy: float,
    width: int,
    height: int,
    done: int,
    count: int,
    memory: Array,
) -> None:
    """Fill in the upper left texel of each position in a picture, and the fractions from there."""
    x_first, by_x, y_first, by_y = _Float(x0), _Float(dx), _Float(y0), _Float(dy)
    zero, half, part = _Float(0), _Float(0.5), _Float(SUBTEXELS)
    # Below the last texel: there are always texels to the right and below.
    far_x, far_y = _Float(width) - _Float(1.001), _Float(height) - _Float(1.001)
    stride, start = np.int32(width), _Index(done)
    for k in range(_padded(count)):
        step = _Float(np.int32(k))
        x = min(max(x_first + step * by_x, zero), far_x)
        y = min(max(y_first + step * by_y, zero), far_y)
        col, row = np.int32(x), np.int32(y)
        memory[_INDEX + start + k] = _UInt(row * stride + col)
        memory[_X + start + k] = _UInt(np.int32((x - _Float(col)) * part + half))
        memory[_Y + start + k] = _UInt(np.int32((y - _Float(row)) * part + half))


@njit(inline="always")
def _run_length(codes: Array, code: int, memory: Array, most: int) -> int:
    """How many pixels from the first on have its set of regions."""
    count = 1
    while count < most and codes[_Index(memory[_INDEX + _Index(count)])] == code:
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _example_weights(
    blend: BlendWeights,
    code: int,
    coefficients: Array,
    used: Array,
    first_used: int,
    end_used: int,
    count: int,
    memory: Array,
    sums: Array,
    weights: Array,
) -> None:
    """Fill in the weight of each example in the set at each pixel."""
    zero = _Float(0)
    first, end = blend.starts[code], blend.starts[code + 1]
    alone = end - first == 1
    for n in range(first_used, end_used):
        start = _Index(n - first_used) * _PITCH
        weight = coefficients[blend.members[first], used[n]] if alone else zero
        for k in range(_padded(count)):
            weights[start + k] = weight
    if alone:
        return
    texels, planes = blend.planes.shape[1], blend.planes.reshape(-1)
    sums[_REST : _REST + _PITCH] = _Float(1)
    for entry in range(first, end):
        region, row = blend.members[entry], _REST
        # The last one has the rest.
        if entry < end - 1:
            _gather(planes, region * texels, blend.width, count, memory)
            _region_weight(memory, count, sums)
            row = _WEIGHT
        for n in range(first_used, end_used):
            start, coefficient = _Index(n - first_used) * _PITCH, coefficients[region, used[n]]
            if coefficient != zero:
                for k in range(_padded(count)):
                    weights[start + k] += coefficient * sums[row + k]


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(texels: Array, start: int, width: int, count: int, memory: Array) -> None:
    """Fill in the four texels around each position."""
    one, below = _Index(1), _Index(width)
    for k in range(_Index(0), _Index(count), _Index(_LANES)):
        prefetch(texels, _Index(start) + _Index(memory[_INDEX + k]) + _PREFETCH_ROWS * below)
    for k in range(_Index(count)):
        n = _Index(start) + _Index(memory[_INDEX + k])
        memory[_UPPER_LEFT + k], memory[_UPPER_RIGHT + k] = texels[n], texels[n + one]
        memory[_LOWER_LEFT + k] = texels[n + below]
        memory[_LOWER_RIGHT + k] = texels[n + below + one]


@njit(inline="always")
def _bilinear(x: np.uint32, y: np.uint32) -> tuple[np.uint32, np.uint32, np.uint32, np.uint32]:
    """Bilinear weights of four texels. They sum to SUBTEXELS exactly: a plain colour stays."""
    half, shift = _UInt(SUBTEXELS // 2), _UInt(8)
    above = _UInt(_UInt(SUBTEXELS) - y)
    upper_right = _UInt(_UInt(x * above + half) >> shift)
    lower_right = _UInt(_UInt(x * y + half) >> shift)
    return _UInt(above - upper_right), upper_right, _UInt(y - lower_right), lower_right


@njit(cache=True, nogil=True, error_model="numpy")
def _region_weight(memory: Array, count: int, sums: Array) -> None:
    """Fill in a region's blend weight at each pixel, and subtract it from the rest."""
    unit = _Float(1 / (SUBTEXELS * WEIGHT_UNIT))
    for k in range(_padded(count)):
        w0, w1, w2, w3 = _bilinear(memory[_X + k], memory[_Y + k])
        weight = _UInt(_UInt(memory[_UPPER_LEFT + k] * w0) + _UInt(memory[_UPPER_RIGHT + k] * w1))
        weight = _UInt(weight + _UInt(memory[_LOWER_LEFT + k] * w2))
        weight = _UInt(weight + _UInt(memory[_LOWER_RIGHT + k] * w3))
        part = unit * _Float(np.int32(weight))
        sums[_WEIGHT + k] = part
        sums[_REST + k] -= part


@njit(cache=True, nogil=True, error_model="numpy")
def _accumulate(memory: Array, weights: Array, example: int, count: int, sums: Array) -> None:
    """Add an example's colours; red and blue share a number, 16 bits for each."""
    start = _Index(example) * _PITCH
    outer, middle, low = _UInt(0xFF00FF), _UInt(0xFF), _UInt(0xFFFF)
    byte, half = _UInt(8), _UInt(16)
    for k in range(_padded(count)):
        w0, w1, w2, w3 = _bilinear(memory[_X + k], memory[_Y + k])
        t0, t1 = memory[_UPPER_LEFT + k], memory[_UPPER_RIGHT + k]
        t2, t3 = memory[_LOWER_LEFT + k], memory[_LOWER_RIGHT + k]
        both = _UInt(_UInt(_UInt(t0 & outer) * w0) + _UInt(_UInt(t1 & outer) * w1))
        both = _UInt(both + _UInt(_UInt(t2 & outer) * w2))
        both = _UInt(both + _UInt(_UInt(t3 & outer) * w3))
        one = _UInt(_UInt(_UInt(t0 >> byte) & middle) * w0)
        one = _UInt(one + _UInt(_UInt(_UInt(t1 >> byte) & middle) * w1))
        one = _UInt(one + _UInt(_UInt(_UInt(t2 >> byte) & middle) * w2))
        one = _UInt(one + _UInt(_UInt(_UInt(t3 >> byte) & middle) * w3))
        weight = weights[start + k]
        sums[_RED + k] += weight * _Float(np.int32(both & low))
        sums[_GREEN + k] += weight * _Float(np.int32(one))
        sums[_BLUE + k] += weight * _Float(np.int32(both >> half))


@njit(cache=True, nogil=True, error_model="numpy")
def _store(sums: Array, pixels: Array, start: int, count: int) -> None:
    zero, top, three = _Float(0), _Float(255), _Index(3)
    for k in range(_Index(count)):
        n = _Index(start) + three * k
        pixels[n] = np.uint8(np.int32(min(max(sums[_RED + k], zero), top)))
        pixels[n + _Index(1)] = np.uint8(np.int32(min(max(sums[_GREEN + k], zero), top)))
        pixels[n + _Index(2)] = np.uint8(np.int32(min(max(sums[_BLUE + k], zero), top)))
