"""The loops behind `Composer`: one pass over the rows of a picture, no buffer of an image.

A row is cut where the set of subregions changes. Along such a piece the examples that count are
the same, and within a triangle places in all photos change by the same steps: each part of the work
is one plain loop over arrays of numbers, which the compiler turns into vector instructions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.prefetch import prefetch
from mien.numeric.raster.piecewise_affine import SUBPIXELS, cut_row, extents
from mien.synthesis.composition.blend_weights import WEIGHT_UNIT, BlendWeights

__all__ = ["PART", "Mixtures", "Photos", "draw_rows"]

PART = 256
"""A place between texels is told in as many parts of their distance."""

_MOST = 64
"""Pixels that are worked on at once."""

_LANES = 16
"""They are worked on in whole vectors: what is beyond their end is not written."""

_Float, _UInt, _Index = np.float32, np.uint32, np.uint64
"""Unsigned indices: those that may be negative would be looked at one by one."""

_AHEAD = _Index(4)
"""Rows from the one that is looked up to that whose texels are asked for, to be there by then."""

# Rows of the kernel's memory are told apart by constants: of arrays of their own the compiler would
# have to make sure, time after time, that none overlaps another.
_PITCH = _Index(_MOST + _LANES)
_INDEX, _X, _Y, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT, _LOWER_RIGHT = (
    _Index(row) * _PITCH for row in range(7)
)
_RED, _GREEN, _BLUE, _FADE, _REST = (_Index(row) * _PITCH for row in range(5))


class Photos(NamedTuple):
    """All examples' photos: (N,) uint32 texels, red lowest; where each begins; widths, heights."""

    texels: Int[Array, " n"]
    starts: Int[Array, " m"]
    widths: Int[Array, " m"]
    heights: Int[Array, " m"]


class Mixtures(NamedTuple):
    """What each subregion is mixed of.

    Attributes:
        shares: (R + 1, m) float32, a PART of them.
        starts: (S + 1,) where the examples that count in each set of subregions begin in `used`.
    """

    shares: Float[Array, "r+1 m"]
    starts: Int[Array, " s+1"]
    used: Int[Array, " k"]


@njit(cache=True, nogil=True, error_model="numpy")
def draw_rows(
    corners: Array,
    triangles: Array,
    maps: Array,
    photos: Photos,
    standard: int,
    faded: BlendWeights,
    mixtures: Mixtures,
    first: int,
    end: int,
    out: Array,
) -> None:
    """Draw what the triangles cover of some rows.

    Args:
        corners: as `mien.numeric.raster.piecewise_affine` has them.
        triangles: as `mien.numeric.raster.piecewise_affine` has them.
        maps: as `mien.numeric.raster.piecewise_affine` has them.
        standard: which photo is the standard image.
        out: (h, w, 3) uint8.
    """
    # Unpacked: arrays in tuples are slow to look at.
    texels, photo_starts, widths, heights = photos
    shares, used_starts, used = mixtures
    width = out.shape[1]
    pixels = out.reshape(-1)
    memory = np.zeros(7 * _PITCH, np.uint32)
    weights = np.zeros(len(widths) * _PITCH, np.float32)
    sums = np.zeros(5 * _PITCH, np.float32)
    tops, ends = extents(corners, triangles)
    found = np.empty((len(triangles), 3), np.int64)
    starts = np.empty(2 * len(triangles) + 2, np.int64)
    spans = np.empty(2 * len(triangles) + 1, np.int64)
    for row in range(first, end):
        count = cut_row(corners, triangles, tops, ends, row, width, found, starts, spans)
        n, col = 0, 0
        while col < width:
            if spans[n] < 0:
                col, n = starts[n + 1], n + 1
                continue
            here = (maps, corners, triangles, row, col, starts, spans, n)
            most = min(width - col, _MOST)
            most = _place(here, standard, faded.width, faded.height, most, memory)
            code = faded.codes[_Index(memory[_INDEX])]
            size = _alike(faded.codes, code, memory, most)
            first_used, end_used = used_starts[code], used_starts[code + 1]
            _weigh(faded, code, shares, used, first_used, end_used, size, memory, sums, weights)
            sums[:] = _Float(0.5)
            for u in range(first_used, end_used):
                i = used[u]
                _place(here, i, widths[i], heights[i], size, memory)
                _look_up(texels, photo_starts[i], widths[i], size, memory)
                _add(memory, weights, u - first_used, size, sums)
            _write(sums, pixels, 3 * (row * width + col), size)
            col += size
            while n < count and starts[n + 1] <= col:
                n += 1


@njit(inline="always")
def _whole(count: int) -> np.uint64:
    """In vectors."""
    return _Index(count + _LANES - 1) & ~_Index(_LANES - 1)


@njit(inline="always")
def _place(here: tuple, picture: int, width: int, height: int, most: int, memory: Array) -> int:
    """Fill in where pixels lie in a picture; how many there are before the triangles end."""
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
        _step(x, maps[t, picture, 1], y, maps[t, picture, 4], width, height, done, count, memory)
        done += count
        n += 1
    return done


@njit(cache=True, nogil=True, error_model="numpy")
def _step(
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
    """Texels above and left of each place in a picture, and the PARTs to it from there."""
    x_first, by_x, y_first, by_y = _Float(x0), _Float(dx), _Float(y0), _Float(dy)
    zero, half, part = _Float(0), _Float(0.5), _Float(PART)
    # Short of the last one: there are always texels to the right and below.
    far_x, far_y = _Float(width) - _Float(1.001), _Float(height) - _Float(1.001)
    stride, start = np.int32(width), _Index(done)
    for k in range(_whole(count)):
        step = _Float(np.int32(k))
        x = min(max(x_first + step * by_x, zero), far_x)
        y = min(max(y_first + step * by_y, zero), far_y)
        col, row = np.int32(x), np.int32(y)
        memory[_INDEX + start + k] = _UInt(row * stride + col)
        memory[_X + start + k] = _UInt(np.int32((x - _Float(col)) * part + half))
        memory[_Y + start + k] = _UInt(np.int32((y - _Float(row)) * part + half))


@njit(inline="always")
def _alike(codes: Array, code: int, memory: Array, most: int) -> int:
    """How many pixels from the first on have its set of subregions."""
    count = 1
    while count < most and codes[_Index(memory[_INDEX + _Index(count)])] == code:
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh(
    faded: BlendWeights,
    code: int,
    shares: Array,
    used: Array,
    first_used: int,
    end_used: int,
    count: int,
    memory: Array,
    sums: Array,
    weights: Array,
) -> None:
    """Fill in the weights of the examples that are used at each pixel."""
    zero = _Float(0)
    first, end = faded.starts[code], faded.starts[code + 1]
    alone = end - first == 1
    for n in range(first_used, end_used):
        start = _Index(n - first_used) * _PITCH
        weight = shares[faded.members[first], used[n]] if alone else zero
        for k in range(_whole(count)):
            weights[start + k] = weight
    if alone:
        return
    texels, planes = faded.planes.shape[1], faded.planes.reshape(-1)
    sums[_REST : _REST + _PITCH] = _Float(1)
    for place in range(first, end):
        region, fade = faded.members[place], _REST
        # The last one has what the others leave.
        if place < end - 1:
            _look_up(planes, region * texels, faded.width, count, memory)
            _fade(memory, count, sums)
            fade = _FADE
        for n in range(first_used, end_used):
            start, share = _Index(n - first_used) * _PITCH, shares[region, used[n]]
            if share != zero:
                for k in range(_whole(count)):
                    weights[start + k] += share * sums[fade + k]


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(texels: Array, start: int, width: int, count: int, memory: Array) -> None:
    """The four texels around each place."""
    one, below = _Index(1), _Index(width)
    for k in range(_Index(0), _Index(count), _Index(_LANES)):
        prefetch(texels, _Index(start) + _Index(memory[_INDEX + k]) + _AHEAD * below)
    for k in range(_Index(count)):
        n = _Index(start) + _Index(memory[_INDEX + k])
        memory[_UPPER_LEFT + k], memory[_UPPER_RIGHT + k] = texels[n], texels[n + one]
        memory[_LOWER_LEFT + k] = texels[n + below]
        memory[_LOWER_RIGHT + k] = texels[n + below + one]


@njit(inline="always")
def _bilinear(x: np.uint32, y: np.uint32) -> tuple[np.uint32, np.uint32, np.uint32, np.uint32]:
    """Weights of four texels. Rounded so that they sum to PART: a plain colour stays."""
    half, shift = _UInt(PART // 2), _UInt(8)
    above = _UInt(_UInt(PART) - y)
    upper_right = _UInt(_UInt(x * above + half) >> shift)
    lower_right = _UInt(_UInt(x * y + half) >> shift)
    return _UInt(above - upper_right), upper_right, _UInt(y - lower_right), lower_right


@njit(cache=True, nogil=True, error_model="numpy")
def _fade(memory: Array, count: int, sums: Array) -> None:
    """Fill in how much of each pixel is a subregion's, and take it from the rest."""
    unit = _Float(1 / (PART * WEIGHT_UNIT))
    for k in range(_whole(count)):
        w0, w1, w2, w3 = _bilinear(memory[_X + k], memory[_Y + k])
        fade = _UInt(_UInt(memory[_UPPER_LEFT + k] * w0) + _UInt(memory[_UPPER_RIGHT + k] * w1))
        fade = _UInt(fade + _UInt(memory[_LOWER_LEFT + k] * w2))
        fade = _UInt(fade + _UInt(memory[_LOWER_RIGHT + k] * w3))
        part = unit * _Float(np.int32(fade))
        sums[_FADE + k] = part
        sums[_REST + k] -= part


@njit(cache=True, nogil=True, error_model="numpy")
def _add(memory: Array, weights: Array, example: int, count: int, sums: Array) -> None:
    """Add an example's colours; red and blue share a number, 16 bits for each."""
    start = _Index(example) * _PITCH
    outer, middle, low = _UInt(0xFF00FF), _UInt(0xFF), _UInt(0xFFFF)
    byte, half = _UInt(8), _UInt(16)
    for k in range(_whole(count)):
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
def _write(sums: Array, pixels: Array, start: int, count: int) -> None:
    zero, top, three = _Float(0), _Float(255), _Index(3)
    for k in range(_Index(count)):
        n = _Index(start) + three * k
        pixels[n] = np.uint8(np.int32(min(max(sums[_RED + k], zero), top)))
        pixels[n + _Index(1)] = np.uint8(np.int32(min(max(sums[_GREEN + k], zero), top)))
        pixels[n + _Index(2)] = np.uint8(np.int32(min(max(sums[_BLUE + k], zero), top)))
