"""The image of an expression from shares of examples, every example resampled once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int, UInt8, check_array, frozen
from mien.errors import InputError
from mien.numeric.raster import rasterize_rows, unfilled
from mien.numeric.threads import for_row_bands
from mien.numeric.warp import corner_places, place
from mien.render.mipmap import UNIT, packed_texels, spread_texel
from mien.synthesis.examples import ExampleSet

__all__ = ["Composer"]

_MIXED, _NONE = -1, -2


class _Photos(NamedTuple):
    """All examples' photos: (N,) uint32 texels, red lowest; where each begins; widths, heights."""

    texels: Int[Array, " n"]
    starts: Int[Array, " m"]
    widths: Int[Array, " m"]
    heights: Int[Array, " m"]


class _Mixtures(NamedTuple):
    """Shares (R, m) float32 of the subregions, those that count in the first `counts` (R,)."""

    shares: Float[Array, "r m"]
    used: Int[Array, "r m"]
    weights: Float[Array, "r m"]
    counts: Int[Array, " r"]


class Composer:
    """Draws expressions of one person over the neutral photo.

    Where the paper aligns examples to the standard image, mixes there and warps the mixture to
    the new points (Z06 sections 6 and 7), each photo is looked up here where the target's pixel
    lies in it, and the shares are looked up in the standard image: colours are resampled once.

    Args:
        examples: photos, their points and the subregions.
        skip: shares up to this are left out, and the others are scaled to the same sum. A value
            changes by less than 255 * 2 * skip * number of examples.
    Raises: InputError: a photo without two rows and columns, a negative skip.
    """

    def __init__(self, examples: ExampleSet, *, skip: float = 1 / 256) -> None:
        if not 0 <= skip < 1:
            raise InputError("skip", "a share from 0 to below 1", skip)
        self._layout, self._skip = examples.layout, float(skip)
        self._background = np.ascontiguousarray(examples.neutral.photo)
        self._photos = _packed([example.photo for example in examples.examples])
        framed = np.stack([self._framed(example.points) for example in examples.examples])
        self._corners = corner_places(framed, examples.layout.triangles)
        self._triangles = frozen(np.ascontiguousarray(examples.layout.triangles, np.int32))
        self._standard = examples.standard
        self._fades = frozen(np.ascontiguousarray(examples.subregions.fades, np.float32))
        self._blocks = _blocks(self._fades)

    def render(
        self,
        points: Float[Array, "n 2"],
        coefficients: Float[Array, "r m"],
        *,
        out: UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 3"]:
        """The expression over the neutral photo, whose pixels outside of the face stay.

        Args:
            points: (n, 2) px of the neutral photo; they may lie outside.
            coefficients: (R, m) shares of the examples in each subregion; rows sum to 1.
            out: memory to draw into.
        Returns: (h, w, 3) sRGB of the neutral photo's size; the same in any number of threads.
        Raises: InputError: shapes, NaN, rows that do not sum to 1.
        Source: Z06 eq. (6), (7).
        """
        points = check_array("points", points, (len(self._layout.names), 2))
        mixtures = self._mixtures(coefficients)
        height, width = self._background.shape[:2]
        if out is None:
            out = np.empty_like(self._background)
        fits = out.shape == self._background.shape and out.dtype == np.uint8
        if not (fits and out.flags.c_contiguous and out.flags.writeable):
            raise InputError("out", f"a writable {width}x{height} image", f"{out.shape}")
        placed = frozen(np.ascontiguousarray(self._framed(points)))
        nearness, raster = frozen(np.ones(len(placed))), unfilled(width, height)
        drawn = (raster.triangle_ids, raster.barycentrics)

        def rows(first: int, end: int) -> None:
            rasterize_rows(
                placed, nearness, self._triangles, False, first, end, *drawn, raster.depth
            )
            faces = (self._corners, self._standard, self._fades, self._blocks, self._photos)
            _compose_rows(*drawn, *faces, mixtures, self._skip, self._background, first, end, out)

        for_row_bands(rows, height, work=4 * width * height)
        return out

    def _framed(self, points: Float[Array, "n 2"]) -> Float[Array, "k 2"]:
        return np.concatenate([points, self._layout.frame(points)])

    def _mixtures(self, coefficients: Float[Array, "r m"]) -> _Mixtures:
        shape = (self._fades.shape[2], len(self._photos.starts))
        shares = check_array("coefficients", coefficients, shape)
        sums = shares.sum(1)
        if np.abs(sums - 1).max() > 1e-3:
            worst = int(np.abs(sums - 1).argmax())
            raise InputError("coefficients", "rows that sum to 1", f"{sums[worst]} in {worst}")
        kept = np.where(np.abs(shares) > self._skip, shares, 0.0)
        # Where all are small, none is left out.
        empty = np.abs(kept.sum(1)) < 0.5
        kept[empty] = shares[empty]
        kept /= kept.sum(1, keepdims=True)
        order = np.argsort(kept == 0, axis=1, kind="stable")
        weights = np.take_along_axis(kept, order, axis=1) / UNIT
        return _Mixtures(
            frozen(shares.astype(np.float32)),
            frozen(order.astype(np.int32)),
            frozen(weights.astype(np.float32)),
            frozen((kept != 0).sum(1).astype(np.int32)),
        )


def _packed(photos: list[UInt8[Array, "h w 3"]]) -> _Photos:
    sizes = np.array([photo.shape[:2] for photo in photos], np.int64)
    if sizes.min() < 2:
        raise InputError("photos", "at least two rows and columns", f"{sizes.min()}")
    texels = np.concatenate([packed_texels(photo) for photo in photos])
    starts = np.concatenate([[0], np.cumsum(sizes.prod(1))[:-1]])
    heights, widths = sizes.T.copy()
    return _Photos(frozen(texels), frozen(starts), frozen(widths), frozen(heights))


def _blocks(fades: Float[Array, "h w r"]) -> Int[Array, "h w"]:
    """Between a pixel and those right of it and below: the subregion that is alone there.

    _NONE outside of the face, _MIXED where there are several.
    """
    best = fades.argmax(2).astype(np.int16)
    top, total = fades.max(2), fades.sum(2)
    codes = np.where(total <= 1e-6, _NONE, np.where(top >= 1 - 1e-6, best, _MIXED)).astype(np.int16)
    wide = np.pad(codes, ((0, 1), (0, 1)), mode="edge")
    others = np.stack([wide[:-1, 1:], wide[1:, :-1], wide[1:, 1:]])
    return frozen(np.where((others == codes).all(0), codes, np.int16(_MIXED)))


@njit(inline="always")
def _look_up(
    texels: Array, start: int, width: int, height: int, x: np.float32, y: np.float32
) -> np.uint64:
    """A photo's colour at x, y px, three lanes of UNIT times 0 to 255."""
    half, edge = np.float32(0.5), np.float32(1.001)
    x = min(max(x - half, np.float32(0)), np.float32(width) - edge)
    y = min(max(y - half, np.float32(0)), np.float32(height) - edge)
    col, row = int(x), int(y)
    unit = np.float32(UNIT)
    right, low = np.float32(x - np.float32(col)), np.float32(y - np.float32(row))
    # Rounded so that they sum to the unit: a plain colour stays.
    below = np.uint64(low * unit + half)
    above = np.uint64(UNIT) - below
    above_right = np.uint64(right * np.float32(above) + half)
    below_right = np.uint64(right * np.float32(below) + half)
    # Unsigned: indices that may be negative would be looked at one by one.
    n = np.uint64(start + row * width + col)
    one, step = np.uint64(1), np.uint64(width)
    total: np.uint64 = spread_texel(texels[n]) * (above - above_right)
    total += spread_texel(texels[n + one]) * above_right
    total += spread_texel(texels[n + step]) * (below - below_right)
    total += spread_texel(texels[n + step + one]) * below_right
    return total


@njit(inline="always")
def _fades_at(
    fades: Array, x: np.float32, y: np.float32, shares: Array, weights: Array
) -> np.float32:
    """Fill in each example's weight at a place of the standard image; the sum of the fades."""
    one = np.float32(1)
    height, width, regions = fades.shape
    col, row = int(x), int(y)
    right, low = np.float32(x - np.float32(col)), np.float32(y - np.float32(row))
    next_col, next_row = min(col + 1, width - 1), min(row + 1, height - 1)
    weights[:] = np.float32(0)
    inside = np.float32(0)
    for r in range(regions):
        above = (one - right) * fades[row, col, r] + right * fades[row, next_col, r]
        below = (one - right) * fades[next_row, col, r] + right * fades[next_row, next_col, r]
        fade = (one - low) * above + low * below
        if fade > np.float32(0):
            inside += fade
            for i in range(weights.shape[0]):
                weights[i] += fade * shares[r, i]
    return inside


@njit(inline="always")
def _kept(weights: Array, inside: np.float32, skip: float, used: Array, kept: Array) -> int:
    """How many examples count at a pixel; which and how much of the sum, into used and kept."""
    count, total = 0, np.float32(0)
    for i in range(weights.shape[0]):
        if abs(weights[i]) > skip * inside:
            used[count], kept[count] = i, weights[i]
            total += weights[i]
            count += 1
    if total < np.float32(0.5) * inside:
        count, total = weights.shape[0], np.float32(0)
        for i in range(count):
            used[i], kept[i] = i, weights[i]
            total += weights[i]
    for n in range(count):
        kept[n] *= inside / (total * np.float32(UNIT))
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _compose_rows(
    ids: Array,
    barycentrics: Array,
    corners: Array,
    standard: int,
    fades: Array,
    blocks: Array,
    photos: _Photos,
    mixtures: _Mixtures,
    skip: float,
    background: Array,
    first: int,
    end: int,
    out: Array,
) -> None:
    """Fill in some rows of the image."""
    half, zero, top = np.float32(0.5), np.float32(0), np.float32(255)
    lane = np.uint64(0x1FFFFF)
    # Unpacked: arrays in tuples are slow to look at.
    texels, starts, widths, heights = photos
    shares, all_used, all_weights, counts = mixtures
    far_x, far_y = np.float32(fades.shape[1] - 1), np.float32(fades.shape[0] - 1)
    out[first:end] = background[first:end]
    mixed = np.empty(len(starts), np.float32)
    used, kept = np.empty(len(starts), np.int32), np.empty(len(starts), np.float32)
    threshold = np.float32(skip)
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0:
                continue
            b0, b1 = barycentrics[row, col, 0], barycentrics[row, col, 1]
            b2 = barycentrics[row, col, 2]
            x, y = place(corners, t, standard, b0, b1, b2)
            x, y = min(max(x - half, zero), far_x), min(max(y - half, zero), far_y)
            region = blocks[int(y), int(x)]
            if region == _NONE:
                continue
            red, green, blue = half, half, half
            if region == _MIXED:
                inside = _fades_at(fades, x, y, shares, mixed)
                if inside <= zero:
                    continue
                count = _kept(mixed, inside, threshold, used, kept)
                rest = max(np.float32(1) - inside, zero)
                red += rest * background[row, col, 0]
                green += rest * background[row, col, 1]
                blue += rest * background[row, col, 2]
            else:
                count = counts[region]
            for n in range(count):
                i = used[n] if region == _MIXED else all_used[region, n]
                weight = kept[n] if region == _MIXED else all_weights[region, n]
                x, y = place(corners, t, i, b0, b1, b2)
                colour = _look_up(texels, starts[i], widths[i], heights[i], x, y)
                red += weight * np.float32(np.int64(colour & lane))
                green += weight * np.float32(np.int64((colour >> np.uint64(21)) & lane))
                blue += weight * np.float32(np.int64(colour >> np.uint64(42)))
            out[row, col, 0] = np.uint8(min(max(red, zero), top))
            out[row, col, 1] = np.uint8(min(max(green, zero), top))
            out[row, col, 2] = np.uint8(min(max(blue, zero), top))
