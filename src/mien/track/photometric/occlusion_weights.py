"""Pixels that show something else than the face: a hand, hair, a highlight."""

from __future__ import annotations

import math

import numpy as np

from mien.arrays import Array, Float
from mien.track.image.bandpass import odd

LEAST_SCALE = 12.0
"""Grey levels: the drawn face is never expected to be nearer to the frame than a third of this."""
_OUTLYING = 4.0
"""Times the usual difference at which a patch is trusted a quarter."""
_PATCH = 0.1
"""Width over which differences are averaged, over the face's: what covers a face is no speck."""
_MEDIAN_SQUARE = 0.455
"""Median over mean of the squares of normal errors."""


def usual_difference(
    drawn: Float[Array, "h w"], target: Float[Array, "h w"], weights: Float[Array, "h w"]
) -> float:
    """Grey levels by which a pixel may be off and still count: three standard deviations."""
    squares = ((target - drawn) ** 2)[weights > 0.25]
    median = float(np.median(squares)) if squares.size else 0.0
    return max(3.0 * math.sqrt(median / _MEDIAN_SQUARE), LEAST_SCALE)


def patch_trust(
    drawn: Float[Array, "h w"],
    target: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    *,
    face_px: float,
) -> Float[Array, "h w"]:
    """(h, w) float32 from 0 to 1: low where the two differ too much, by Geman and McClure's

    weights of differences averaged over patches; 1 where the weights are 0.
    """
    import cv2

    known = weights > 0.25
    if not known.any():
        return np.ones_like(weights)
    squares = np.where(known, (target - drawn) ** 2, np.float32(0))
    width = odd(_PATCH * face_px)
    square = (width, width)
    around = cv2.blur(squares, square, borderType=cv2.BORDER_CONSTANT)
    shares = cv2.blur(known.astype(np.float32), square, borderType=cv2.BORDER_CONSTANT)
    around = around / np.maximum(shares, 1e-6)
    least = (LEAST_SCALE / 3) ** 2
    usual = max(float(np.median(around[known])), least)
    return np.where(known, 1 / (1 + around / (_OUTLYING**2 * usual)) ** 2, 1).astype(np.float32)
