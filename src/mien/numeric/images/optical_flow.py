"""Dense matching of two images that are nearly alike: local contrast, optical flow, correlation."""

from __future__ import annotations

from typing import Any

import numpy as np

from mien.arrays import Array, Bool, Float

_NOISE_FLOOR = 3.0
"""Grey levels (of 255): contrast below this is noise and is not amplified."""
_CONTRAST = 45.0
"""Grey levels that one local standard deviation becomes in the 8-bit image that is matched."""
_CORRELATION_PX = 2.5


def normalize_contrast(
    image: Float[Array, "h w"], mask: Bool[Array, "h w"], radius_px: float
) -> Float[Array, "h w"]:
    """The image less its local mean, over its local deviation; 0 outside of the mask.

    Takes out exposure, white balance and shading, all of which vary slowly. Only pixels within
    the mask count for the statistics, so that a background does not darken what is before it.

    Args:
        image: (H, W) from 0 to 255.
        radius_px: about the size of what is kept.
    """
    import cv2

    # A box filter three times over is nearly a Gaussian, at a cost that its size does not change.
    side = 2 * round(radius_px) + 1

    def blurred(values: Array) -> Array:
        for _ in range(3):
            values = np.asarray(cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT))
        return values

    inside = mask.astype(np.float32)
    share = np.maximum(blurred(inside), 1e-3)
    centered = np.asarray(image, np.float32) * inside
    centered -= blurred(centered) / share * inside
    # The running sums of a box filter can come out a hair below zero.
    variance = np.maximum(blurred(centered * centered), 0) / share
    return centered / (np.sqrt(variance) + _NOISE_FLOOR)


def optical_flow(
    a: Float[Array, "h w"], b: Float[Array, "h w"], *, fine: bool = False
) -> Float[Array, "h w 2"]:
    """(H, W, 2) px: where each pixel of a is found in b, less its own place.

    Both are of local contrast (`normalize_contrast`). Dense inverse search flow (Kroeger et al.,
    Fast Optical Flow using Dense Inverse Search, 2016) down to single pixels.

    Args:
        fine: of waves 18 px long half the height is found instead of a quarter, at twice the noise:
            for those who average.
    """
    return _searcher(fine).calc(_eight_bit(a), _eight_bit(b), None)


def local_correlation(
    a: Float[Array, "h w"], b: Float[Array, "h w"], radius_px: float = _CORRELATION_PX
) -> Float[Array, "h w"]:
    """(H, W) from -1 to 1: how alike the surroundings of each pixel are."""
    import cv2

    side = 2 * round(2 * radius_px) + 1

    def mean(values: Array) -> Array:
        return cv2.blur(values, (side, side))

    mean_a, mean_b = mean(a), mean(b)
    covariance = mean(a * b) - mean_a * mean_b
    variances = (mean(a * a) - mean_a * mean_a) * (mean(b * b) - mean_b * mean_b)
    return covariance / np.sqrt(np.maximum(variances, 1e-6))


def _eight_bit(image: Array) -> Array:
    return np.clip(128 + _CONTRAST * image, 0, 255).astype(np.uint8)


def _searcher(fine: bool) -> Any:
    """Not kept: it is not safe in two threads at once.

    On rendered pairs with exact truth these settings are as near to it as the preset's, in less
    than half the time (docs/method/registration.md).
    """
    import cv2

    searcher = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    searcher.setFinestScale(0)
    searcher.setPatchStride(5)
    searcher.setGradientDescentIterations(12)
    searcher.setVariationalRefinementIterations(5 if fine else 2)
    # How smooth the flow is to be; the preset has 20.
    searcher.setVariationalRefinementAlpha(5.0 if fine else 20.0)
    return searcher
