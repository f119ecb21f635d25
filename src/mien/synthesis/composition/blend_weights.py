"""Blend weights of the subregions, packed for the composer's kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8, frozen

__all__ = ["WEIGHT_UNIT", "BlendWeights", "pack_blend_weights"]

WEIGHT_UNIT = 255


class BlendWeights(NamedTuple):
    """Weights of the R subregions and, last, of the background, at each pixel of an image.

    Pixels are grouped by which regions contribute: mostly one, rarely more than three.

    Attributes:
        width: of the standard image.
        height: of the standard image.
        codes: (h * w,) row after row: the set of the regions with a weight at a pixel or at its
            neighbours to the right and below.
        starts: (S + 1,) where each set begins in `members`.
        members: indices of regions, set after set.
        table: (S, R + 1) the same sets, whether each region is in each.
        planes: (R + 1, h * w) weights as integers that sum to WEIGHT_UNIT.
    """

    width: int
    height: int
    codes: Int[Array, " n"]
    starts: Int[Array, " s+1"]
    members: Int[Array, " k"]
    table: Bool[Array, "s r+1"]
    planes: UInt8[Array, "r+1 n"]


def pack_blend_weights(weights: Float[Array, "h w r"]) -> BlendWeights:
    """Rounded weights, and the sets of regions that they make.

    Args:
        weights: (h, w, R) of the subregions; they sum to at most 1, the background has the rest.
    """
    height, width, regions = weights.shape
    planes = _rounded(weights).reshape(-1, regions + 1).T
    at_pixel = (planes > 0).reshape(-1, height, width)
    padded = np.pad(at_pixel, ((0, 0), (0, 1), (0, 1)), mode="edge")
    near = padded[:, :-1, :-1] | padded[:, 1:, :-1] | padded[:, :-1, 1:] | padded[:, 1:, 1:]
    # Sorting a row of bytes a pixel is slow: the sets are encoded as the bits of integers.
    packed = np.packbits(near.reshape(regions + 1, -1), axis=0)
    keys = np.zeros(packed.shape[1], np.int64)
    for row in packed:
        keys = np.unique(keys * 256 + row, return_inverse=True)[1]
    _, first, codes = np.unique(keys, return_index=True, return_inverse=True)
    table = near.reshape(regions + 1, -1)[:, first].T
    return BlendWeights(
        width,
        height,
        frozen(codes.astype(np.int32)),
        frozen(np.concatenate([[0], np.cumsum(table.sum(1))]).astype(np.int32)),
        frozen(np.nonzero(table)[1].astype(np.int32)),
        frozen(table),
        frozen(np.ascontiguousarray(planes)),
    )


def _rounded(weights: Float[Array, "h w r"]) -> UInt8[Array, "h w r+1"]:
    """With the background; the greatest weight takes the rounding error."""
    background = np.maximum(1 - weights.sum(2, keepdims=True), 0)
    whole = np.concatenate([weights, background], axis=2)
    parts = np.floor(whole * WEIGHT_UNIT + 0.5).astype(np.int16)
    greatest = whole.argmax(2, keepdims=True)
    error = WEIGHT_UNIT - parts.sum(2, keepdims=True, dtype=np.int16)
    np.put_along_axis(parts, greatest, np.take_along_axis(parts, greatest, 2) + error, 2)
    return parts.astype(np.uint8)
