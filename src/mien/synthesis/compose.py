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
from mien.synthesis.motion import PlanarMotion, estimate_planar_motion

__all__ = ["Composer"]

_MIXED = -1


class _Photos(NamedTuple):
    """All examples' photos: (N,) uint32 texels, red lowest; where each begins; widths, heights."""

    texels: Int[Array, " n"]
    starts: Int[Array, " m"]
    widths: Int[Array, " m"]
    heights: Int[Array, " m"]


class _Mixtures(NamedTuple):
    """Shares (R + 1, m) float32 of the subregions, those that count in the first `counts`.

    The last row is that of the surroundings, which are the neutral example's.
    """

    shares: Float[Array, "r m"]
    used: Int[Array, "r m"]
    weights: Float[Array, "r m"]
    counts: Int[Array, " r"]


class Composer:
    """Draws expressions of one person into the neutral photo.

    Where the paper aligns examples to the standard image, mixes there and warps the mixture to
    the new points (Z06 sections 6 and 7), each photo is looked up here where the target's pixel
    lies in it, and the shares are looked up in the standard image: colours are resampled once.
    Around the subregions, out to the triangulation's frame, the neutral photo is looked up in the
    same way: hair and neck follow the jaw. From the frame on it moves with the head.

    Args:
        examples: photos, their points and the subregions.
        skip: shares up to this are left out, and the others are scaled to the same sum. A value
            changes by less than 255 * 2 * skip * number of examples.
    Raises: InputError: a photo without two rows and columns, a negative skip.
    """

    def __init__(self, examples: ExampleSet, *, skip: float = 1 / 256) -> None:
        if not 0 <= skip < 1:
            raise InputError("skip", "a share from 0 to below 1", skip)
        layout = examples.layout
        self._layout, self._skip = layout, float(skip)
        self._neutral, self._neutral_points = examples.neutral.photo, examples.neutral.points
        self._frame = frozen(layout.frame(self._neutral_points))
        self._photos = _packed([example.photo for example in examples.examples])
        places = [example.points for example in examples.examples]
        framed = np.stack([self._framed(points, self.head_motion(points)) for points in places])
        self._corners = corner_places(framed, layout.triangles)
        self._triangles = frozen(np.ascontiguousarray(layout.triangles, np.int32))
        self._standard = examples.standard
        self._fades = _with_surroundings(examples.subregions.fades)
        self._blocks = _blocks(self._fades)

    def head_motion(self, points: Float[Array, "n 2"]) -> PlanarMotion:
        """What the head did between the neutral photo and another, from points that are rigid.

        Args:
            points: (n, 2) px of the other photo.
        Raises: InputError: shape, NaN. EstimationError: rigid points in one place.
        Source: Z06 eq. (8), (9). All points would take an open jaw for a head that nods.
        """
        points = check_array("points", points, self._neutral_points.shape)
        rigid = self._layout.rigid
        return estimate_planar_motion(self._neutral_points[rigid], points[rigid])

    def render(
        self,
        points: Float[Array, "n 2"],
        coefficients: Float[Array, "r m"],
        *,
        motion: PlanarMotion | None = None,
        size: tuple[int, int] | None = None,
        out: UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 3"]:
        """The expression in the neutral photo.

        Args:
            points: (n, 2) px of the picture; they may lie outside.
            coefficients: (R, m) shares of the examples in each subregion; rows sum to 1.
            motion: of the head, from the neutral photo to the picture; none unless given.
            size: width and height of the picture; the neutral photo's unless given. Beyond its
                edges the neutral photo goes on as it is there.
            out: memory to draw into.
        Returns: (h, w, 3) sRGB; the same in any number of threads.
        Raises: InputError: shapes, NaN, rows that do not sum to 1.
        Source: Z06 eq. (6), (7), (8).
        """
        points = check_array("points", points, self._neutral_points.shape)
        mixtures = self._mixtures(coefficients)
        placed = frozen(self._framed(points, motion))
        out = self._background(motion, size, out)
        height, width = out.shape[:2]
        nearness, raster = frozen(np.ones(len(placed))), unfilled(width, height)
        drawn = (raster.triangle_ids, raster.barycentrics)

        def rows(first: int, end: int) -> None:
            rasterize_rows(
                placed, nearness, self._triangles, False, first, end, *drawn, raster.depth
            )
            faces = (self._corners, self._standard, self._fades, self._blocks, self._photos)
            _compose_rows(*drawn, *faces, mixtures, first, end, out)

        for_row_bands(rows, height, work=4 * width * height)
        return out

    def _framed(
        self, points: Float[Array, "n 2"], motion: PlanarMotion | None
    ) -> Float[Array, "k 2"]:
        """All corners of the triangles: where the neutral photo's frame goes, expressions end."""
        frame = self._frame if motion is None else motion(self._frame)
        return np.concatenate([points, frame])

    def _background(
        self,
        motion: PlanarMotion | None,
        size: tuple[int, int] | None,
        out: UInt8[Array, "h w 3"] | None,
    ) -> UInt8[Array, "h w 3"]:
        """The neutral photo moved with the head, in memory of its own unless some is given."""
        import cv2

        width, height = size or self._neutral.shape[1::-1]
        if min(width, height) < 1:
            raise InputError("size", "a width and height of at least 1", size)
        if out is None:
            out = np.empty((height, width, 3), np.uint8)
        fits = out.shape == (height, width, 3) and out.dtype == np.uint8
        if not (fits and out.flags.c_contiguous and out.flags.writeable):
            raise InputError("out", f"a writable {width}x{height} image", f"{out.shape}")
        if motion is None and out.shape == self._neutral.shape:
            np.copyto(out, self._neutral)
            return out
        # OpenCV counts from the centre of the first pixel.
        corners = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5]])
        start, right, down = (corners if motion is None else motion(corners)) - 0.5
        matrix = np.stack([right - start, down - start, start], axis=1)
        cv2.warpAffine(self._neutral, matrix, (width, height), out, borderMode=cv2.BORDER_REPLICATE)
        return out

    def _mixtures(self, coefficients: Float[Array, "r m"]) -> _Mixtures:
        shape = (self._fades.shape[2] - 1, len(self._photos.starts))
        shares = check_array("coefficients", coefficients, shape)
        sums = shares.sum(1)
        if np.abs(sums - 1).max() > 1e-3:
            worst = int(np.abs(sums - 1).argmax())
            raise InputError("coefficients", "rows that sum to 1", f"{sums[worst]} in {worst}")
        shares = np.vstack([shares, np.eye(1, shape[1])])
        kept = np.where(np.abs(shares) > self._skip, shares, 0.0)
        # Where all are small, none is left out.
        empty = np.abs(kept.sum(1)) < 0.5
        kept[empty] = shares[empty]
        kept /= kept.sum(1, keepdims=True)
        kept /= UNIT
        order = np.argsort(kept == 0, axis=1, kind="stable")
        return _Mixtures(
            frozen(kept.astype(np.float32)),
            frozen(order.astype(np.int32)),
            frozen(np.take_along_axis(kept, order, axis=1).astype(np.float32)),
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


def _with_surroundings(fades: Float[Array, "h w r"]) -> Float[Array, "h w r+1"]:
    """Fades of the subregions and, last, of what is none of them: they sum to 1."""
    rest = np.maximum(1 - fades.sum(2, keepdims=True), 0)
    return frozen(np.concatenate([fades, rest], axis=2, dtype=np.float32))


def _blocks(fades: Float[Array, "h w r"]) -> Int[Array, "h w"]:
    """Between a pixel and those right of it and below: the subregion that is alone there.

    _MIXED where there are several.
    """
    best = fades.argmax(2).astype(np.int16)
    codes = np.where(fades.max(2) >= 1 - 1e-6, best, _MIXED).astype(np.int16)
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
def _mix_at(fades: Array, x: np.float32, y: np.float32, shares: Array, weights: Array) -> None:
    """Fill in each example's weight at a place of the standard image."""
    one = np.float32(1)
    height, width, regions = fades.shape
    col, row = int(x), int(y)
    right, low = np.float32(x - np.float32(col)), np.float32(y - np.float32(row))
    next_col, next_row = min(col + 1, width - 1), min(row + 1, height - 1)
    weights[:] = np.float32(0)
    for r in range(regions):
        above = (one - right) * fades[row, col, r] + right * fades[row, next_col, r]
        below = (one - right) * fades[next_row, col, r] + right * fades[next_row, next_col, r]
        fade = (one - low) * above + low * below
        if fade > np.float32(0):
            for i in range(weights.shape[0]):
                weights[i] += fade * shares[r, i]


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
    first: int,
    end: int,
    out: Array,
) -> None:
    """Fill in what the triangles hold of some rows of the image."""
    half, zero, top = np.float32(0.5), np.float32(0), np.float32(255)
    lane = np.uint64(0x1FFFFF)
    # Unpacked: arrays in tuples are slow to look at.
    texels, starts, widths, heights = photos
    shares, all_used, all_weights, counts = mixtures
    far_x, far_y = np.float32(fades.shape[1] - 1), np.float32(fades.shape[0] - 1)
    mixed = np.empty(len(starts), np.float32)
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
            if region == _MIXED:
                _mix_at(fades, x, y, shares, mixed)
                count = len(starts)
            else:
                count = counts[region]
            red, green, blue = half, half, half
            for n in range(count):
                i = n if region == _MIXED else all_used[region, n]
                weight = mixed[n] if region == _MIXED else all_weights[region, n]
                if weight == zero:
                    continue
                x, y = place(corners, t, i, b0, b1, b2)
                colour = _look_up(texels, starts[i], widths[i], heights[i], x, y)
                red += weight * np.float32(np.int64(colour & lane))
                green += weight * np.float32(np.int64((colour >> np.uint64(21)) & lane))
                blue += weight * np.float32(np.int64(colour >> np.uint64(42)))
            out[row, col, 0] = np.uint8(min(max(red, zero), top))
            out[row, col, 1] = np.uint8(min(max(green, zero), top))
            out[row, col, 2] = np.uint8(min(max(blue, zero), top))
