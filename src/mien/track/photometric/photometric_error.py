"""How well the drawn face explains a frame, and which pixels show something else."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.kernels.jit import njit
from mien.track.image.bandpass import odd
from mien.track.image.frame_pyramid import BRIGHTEST, FrameCrop
from mien.track.photometric.linearization import ImagePair

_MIN_WEIGHT = 0.25
"""Pixels above this weight are compared."""
_MIN_CONTRAST = 0.03
"""Grey levels, standard deviation."""
MIN_OUTLIER_SCALE = 12.0
"""Grey levels; three times the smallest standard deviation of a residual that is assumed."""
_OUTLIER_RATIO = 4.0
"""RMS residual of a patch over the median patch's at which its weight is a quarter."""
_PATCH = 0.1
"""Width of a patch over the face's: what covers a face is larger than single pixels."""
_MEDIAN_SQUARE = 0.455
"""Median over mean of the squares of normal errors."""


class PhotometricError(NamedTuple):
    """Difference and correlation of frame and drawn face.

    Attributes:
        rms: grey levels, over the pixels that are compared.
        seen: their share of the face.
        ncc: normalized cross-correlation over them, from -1 to 1.
    """

    rms: float
    seen: float
    ncc: float


def photometric_error(
    image_pair: ImagePair, crop: FrameCrop, weights: Float[Array, "h w"]
) -> PhotometricError:
    """Of plain luma.

    Args:
        image_pair: drawn face and frame.
        crop: that they are of.
        weights: (h, w) float32 of the pixels. Saturated pixels are left out of the face's area:
            they are neither covered nor outside of the frame.
    """
    sums = np.zeros(8)
    _add(image_pair, crop.pixels, crop.valid, weights, sums)
    shown, total, count, a, b, aa, bb, ab = sums.tolist()
    seen = total / max(shown, 1)
    if count < 2:
        return PhotometricError(np.inf, seen, 0.0)
    rms = np.sqrt(max(aa - 2 * ab + bb, 0) / count)
    spread = np.sqrt(max(aa - a * a / count, 0) * max(bb - b * b / count, 0))
    # Without contrast there is no correlation.
    ncc = (ab - a * b / count) / max(float(spread), _MIN_CONTRAST**2 * count)
    return PhotometricError(float(rms), seen, ncc)


@njit(cache=True, nogil=True)
def _add(image_pair: ImagePair, pixels: Array, inside: Array, weights: Array, sums: Array) -> None:
    """Add up the face's unsaturated pixels, weights; then compared pixels, luma and products."""
    _, mask, drawn, target = image_pair
    for row in range(len(mask)):
        for col in range(mask.shape[1]):
            if mask[row, col] == 0:
                continue
            brightest = max(pixels[row, col, 0], pixels[row, col, 1], pixels[row, col, 2])
            if inside[row, col] >= 0.5 or brightest <= BRIGHTEST:
                sums[0] += 1
            sums[1] += weights[row, col]
            if weights[row, col] > _MIN_WEIGHT:
                a, b = np.float64(drawn[row, col]), np.float64(target[row, col])
                sums[2] += 1
                sums[3] += a
                sums[4] += b
                sums[5] += a * a
                sums[6] += b * b
                sums[7] += a * b


def outlier_scale(
    drawn: Float[Array, "h w"], target: Float[Array, "h w"], weights: Float[Array, "h w"]
) -> float:
    """Grey levels, three standard deviations of the residual, by its median: a robust scale."""
    squares = ((target - drawn) ** 2)[weights > _MIN_WEIGHT]
    median = float(np.median(squares)) if squares.size else 0.0
    return max(3.0 * math.sqrt(median / _MEDIAN_SQUARE), MIN_OUTLIER_SCALE)


def occlusion_weights(
    drawn: Float[Array, "h w"],
    target: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    *,
    face_px: float,
) -> Float[Array, "h w"]:
    """(h, w) float32 from 0 to 1: low where something covers the face.

    Geman and McClure's weights of residuals that are averaged over patches.

    Args:
        drawn: luma of the face.
        target: luma of the frame.
        weights: of the pixels; where they are 0, the result is 1.
        face_px: width of the face.
    """
    import cv2

    known = weights > _MIN_WEIGHT
    if not known.any():
        return np.ones_like(weights)
    squares = np.where(known, (target - drawn) ** 2, np.float32(0))
    width = odd(_PATCH * face_px)
    square = (width, width)
    around = cv2.blur(squares, square, borderType=cv2.BORDER_CONSTANT)
    coverage = cv2.blur(known.astype(np.float32), square, borderType=cv2.BORDER_CONSTANT)
    around = around / np.maximum(coverage, 1e-6)
    smallest = (MIN_OUTLIER_SCALE / 3) ** 2
    typical = max(float(np.median(around[known])), smallest)
    outlying = around / (_OUTLIER_RATIO**2 * typical)
    return np.where(known, 1 / (1 + outlying) ** 2, 1).astype(np.float32)
