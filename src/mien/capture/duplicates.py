"""Photos that were given twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.capture.faces.landmarks import Landmarks

if TYPE_CHECKING:
    from mien.capture.source import CapturedView

_THUMBNAIL = 32
_SAME_BRIGHTNESS = 1.0
_SAME_PLACE = 0.02


def same_photo(one: CapturedView, other: CapturedView) -> bool:
    """Equal pixels, or a copy that was saved again or resized.

    Copies differ by some tenths of a grey level in the mean of a 32x32 thumbnail, and in their
    landmarks by 1 % of the distance between the eyes, for the detector is no steadier.
    """
    first, second = one.photo.pixels, other.photo.pixels
    if first.shape == second.shape and np.array_equal(first, second):
        return True
    if one.landmarks is None or other.landmarks is None:
        return False
    aspect = np.log(first.shape[0] * second.shape[1] / (first.shape[1] * second.shape[0]))
    if abs(aspect) > 0.01:
        return False
    difference = np.abs(_thumbnail(first) - _thumbnail(second)).mean()
    return bool(difference < _SAME_BRIGHTNESS) and _landmarks_agree(
        one.landmarks, other.landmarks, first.shape[1] / second.shape[1]
    )


def _landmarks_agree(one: Landmarks, other: Landmarks, factor: float) -> bool:
    """After scaling the second photo by `factor` to the first one's size."""
    moved = np.linalg.norm(one.points - factor * other.points, axis=1)
    return bool(np.median(moved) < _SAME_PLACE * one.eye_distance_px)


def _thumbnail(pixels: UInt8[Array, "h w 3"]) -> Float[Array, "t t 3"]:
    import cv2

    size = (_THUMBNAIL, _THUMBNAIL)
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.float64)
