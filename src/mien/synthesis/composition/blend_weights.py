"""Which subregions meet at each pixel of the standard image, and how much of it is each one's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8, frozen

__all__ = ["WEIGHT_UNIT", "BlendWeights", "pack_blend_weights"]

WEIGHT_UNIT = 255


class BlendWeights(NamedTuple):
    """The R subregions and, last, what is around them. Most places have one, few more than three.

    Attributes:
        width: of the standard image.
        height: of the standard image.
        codes: (h * w,) row after row: which set of subregions counts somewhere between a pixel and
            those right of it and below.
        starts: (S + 1,) where each set begins in `members`.
        members: indices of subregions.
        holds: (S, R + 1) the same as a table.
        planes: (R + 1, h * w) fades, WEIGHT_UNIT is all; they sum to it.
    """

    width: int
    height: int
    codes: Int[Array, " n"]
    starts: Int[Array, " s+1"]
    members: Int[Array, " k"]
    holds: Bool[Array, "s r+1"]
    planes: UInt8[Array, "r+1 n"]


def pack_blend_weights(fades: Float[Array, "h w r"]) -> BlendWeights:
    """Of subregions' fades, which sum to at most 1."""
    height, width, regions = fades.shape
    planes = _rounded(fades).reshape(-1, regions + 1).T
    here = (planes > 0).reshape(-1, height, width)
    wide = np.pad(here, ((0, 0), (0, 1), (0, 1)), mode="edge")
    near = wide[:, :-1, :-1] | wide[:, 1:, :-1] | wide[:, :-1, 1:] | wide[:, 1:, 1:]
    # Sorting a row of bytes a pixel is slow: the sets are told by the bits of one number or more.
    packed = np.packbits(near.reshape(regions + 1, -1), axis=0)
    keys = np.zeros(packed.shape[1], np.int64)
    for row in packed:
        keys = np.unique(keys * 256 + row, return_inverse=True)[1]
    _, first, codes = np.unique(keys, return_index=True, return_inverse=True)
    holds = near.reshape(regions + 1, -1)[:, first].T
    return BlendWeights(
        width,
        height,
        frozen(codes.astype(np.int32)),
        frozen(np.concatenate([[0], np.cumsum(holds.sum(1))]).astype(np.int32)),
        frozen(np.nonzero(holds)[1].astype(np.int32)),
        frozen(holds),
        frozen(np.ascontiguousarray(planes)),
    )


def _rounded(fades: Float[Array, "h w r"]) -> UInt8[Array, "h w r+1"]:
    """With what is around: the greatest takes what rounding leaves."""
    around = np.maximum(1 - fades.sum(2, keepdims=True), 0)
    whole = np.concatenate([fades, around], axis=2)
    parts = np.floor(whole * WEIGHT_UNIT + 0.5).astype(np.int16)
    greatest = whole.argmax(2, keepdims=True)
    left = WEIGHT_UNIT - parts.sum(2, keepdims=True, dtype=np.int16)
    np.put_along_axis(parts, greatest, np.take_along_axis(parts, greatest, 2) + left, 2)
    return parts.astype(np.uint8)
