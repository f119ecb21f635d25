"""Band-pass filtered pictures of a face: colour differences between cameras drop out (P02 sec. 6.2).

At one level of a pyramid, a picture less its own blur: what is finer than the level's pixels is
gone already, what is coarser than the blur goes here. Only the face's own pixels are averaged, so
that nothing of the background, or of a hand before the face, gets in.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mien.arrays import Array, Float
from mien.numeric.threads import for_row_bands


def band_pass(
    layers: Float[Array, "h w k 3"],
    target: Float[Array, "h w 3"],
    mask: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    width: int,
) -> tuple[Float[Array, "h w k 3"], Float[Array, "h w 3"]]:
    """Layers and target less their means over the pixels around; 0 outside of the mask.

    Args:
        mask: (h, w) 0 or 1. weights: (h, w) of the pixels in the means.
        width: px, odd, side of the square whose mean goes.
    """
    import cv2

    height, columns, count, _ = layers.shape
    # At the outline a frame's pixel mixes the face with what is behind it.
    inner = cv2.erode(mask, np.ones((3, 3), np.uint8)) * weights
    both = np.empty((height, columns, 3 * count + 4), np.float32)
    for_row_bands(
        lambda a, b: _stack_rows(layers, target, inner, a, b, both), height, work=both.size
    )
    sums = cv2.blur(both, (width, width), borderType=cv2.BORDER_CONSTANT)
    bands, band = np.empty_like(layers), np.empty_like(target)
    for_row_bands(
        lambda a, b: _subtract_rows(layers, target, mask, sums, a, b, bands, band),
        height,
        work=both.size,
    )
    return bands, band


@njit(cache=True, nogil=True)
def _stack_rows(
    layers: Array, target: Array, inner: Array, first: int, end: int, both: Array
) -> None:
    """Fill in layers, target and 1, all times the weights."""
    last = both.shape[2] - 4
    for row in range(first, end):
        for col in range(inner.shape[1]):
            weight = inner[row, col]
            both[row, col, last + 3] = weight
            if weight == 0.0:
                both[row, col] = 0.0
                continue
            for c in range(3):
                both[row, col, last + c] = weight * target[row, col, c]
                for n in range(layers.shape[2]):
                    both[row, col, 3 * n + c] = weight * layers[row, col, n, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _subtract_rows(
    layers: Array,
    target: Array,
    mask: Array,
    sums: Array,
    first: int,
    end: int,
    bands: Array,
    band: Array,
) -> None:
    last = sums.shape[2] - 4
    for row in range(first, end):
        for col in range(mask.shape[1]):
            share = sums[row, col, last + 3]
            if mask[row, col] == 0.0 or share < 1e-6:
                bands[row, col] = 0.0
                band[row, col] = 0.0
                continue
            inverse = np.float32(1.0) / share
            for c in range(3):
                band[row, col, c] = target[row, col, c] - sums[row, col, last + c] * inverse
                for n in range(layers.shape[2]):
                    mean = sums[row, col, 3 * n + c] * inverse
                    bands[row, col, n, c] = layers[row, col, n, c] - mean


def odd(width: float) -> int:
    """The nearest odd number of pixels, 3 at least."""
    return max(3, 2 * round((width - 1) / 2) + 1)
