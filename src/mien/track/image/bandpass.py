"""Band-pass filtered pictures of a face, which depend less on lighting and on the camera's colours.

A picture of one pyramid level less its own blur: the level holds nothing finer than its pixels, and
the difference removes what is coarser than the blur. Means are taken over the face's own pixels, so
that neither the background nor a hand before the face changes them.

Source:
    [Pighin 2002] sec. 6.2.
"""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands

_PARTS = 2
"""In which a picture is filtered, each with the rows around it that its means need."""


def band_pass(
    layers: Float[Array, "h w k"],
    luma: Float[Array, "h w"],
    target: Float[Array, "h w"],
    mask: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    width: int,
) -> tuple[Float[Array, "h w k"], Float[Array, "h w"], Float[Array, "h w"]]:
    """Layers, their mixture and the target, less their means over the pixels around.

    The mixture is filtered itself: where blending weights vary, a mixture of filtered layers is
    something else.

    Args:
        layers: (h, w, K) one picture for each expression.
        luma: (h, w) their mixture.
        target: (h, w) of the frame.
        mask: (h, w) 0 or 1. Outside, the results are 0, except the target's, which extends as far
            as there are means.
        weights: (h, w) of pixels in the means.
        width: px, odd, side of the square over which means are taken.
    """
    import cv2

    # At the outline a pixel of the frame mixes the face with what is behind it.
    inner = cv2.erode(mask, np.ones((3, 3), np.uint8))
    inner *= weights
    inputs = (layers, luma, target)
    bands = (np.empty_like(layers), np.empty_like(luma), np.empty_like(target))
    height, count = len(mask), layers.shape[2] + 3

    def rows(first: int, end: int) -> None:
        low, high = max(first - width // 2, 0), min(end + width // 2, height)
        weighted = np.empty((high - low, mask.shape[1], count), np.float32)
        _weigh_rows(*inputs, inner, low, weighted)
        sums = cv2.blur(weighted, (width, width), borderType=cv2.BORDER_CONSTANT)
        _subtract_rows(*inputs, mask, sums[first - low : end - low], first, *bands)

    def parts(first: int, end: int) -> None:
        for part in range(first, end):
            rows(part * height // _PARTS, (part + 1) * height // _PARTS)

    for_row_bands(parts, _PARTS, work=2 * mask.size * count)
    return bands


@njit(cache=True, nogil=True)
def _weigh_rows(
    layers: Array,
    luma: Array,
    target: Array,
    inner: Array,
    first: int,
    weighted: Array,
) -> None:
    """Fill in layers, luma, target and 1, all times the weights, of rows from `first` on."""
    count = layers.shape[2]
    for own in range(len(weighted)):
        row = first + own
        for col in range(inner.shape[1]):
            weight = inner[row, col]
            for n in range(count):
                weighted[own, col, n] = weight * layers[row, col, n]
            weighted[own, col, count] = weight * luma[row, col]
            weighted[own, col, count + 1] = weight * target[row, col]
            weighted[own, col, count + 2] = weight


@njit(cache=True, nogil=True, error_model="numpy")
def _subtract_rows(
    layers: Array,
    luma: Array,
    target: Array,
    mask: Array,
    sums: Array,
    first: int,
    layer_bands: Array,
    luma_band: Array,
    target_band: Array,
) -> None:
    count, smallest = layers.shape[2], np.float32(1e-6)
    for own in range(len(sums)):
        row = first + own
        for col in range(mask.shape[1]):
            total = sums[own, col, count + 2]
            shown = mask[row, col] > 0.0 and total > smallest
            # Outside everything is 0: a picture and its mean alike.
            inverse = np.float32(1.0) / total if shown else np.float32(0.0)
            keep = np.float32(1.0) if shown else np.float32(0.0)
            for n in range(count):
                mean = sums[own, col, n] * inverse
                layer_bands[row, col, n] = keep * layers[row, col, n] - mean
            luma_band[row, col] = keep * luma[row, col] - sums[own, col, count] * inverse
            target_band[row, col] = 0.0
            if total > smallest:
                target_band[row, col] = target[row, col] - sums[own, col, count + 1] / total


def odd(width: float) -> int:
    """The nearest odd number of pixels, 3 at least."""
    return max(3, 2 * round((width - 1) / 2) + 1)
