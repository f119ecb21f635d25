"""Tells pictures in which something, most often a hand, is before the mouth."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.feature_points import FeatureLayout
from mien.capture.images.photos import shrunk
from mien.numeric.raster.rasterizer import rasterize
from mien.synthesis.composition.example_warping import warp_to_raster

__all__ = ["LipContrast"]

MIN_CONTRAST = 0.1
"""What must be left of how the lips usually differ from the skin. On seven clips without hands
(3958 frames) no quarter of the lips ever keeps less than 0.13 of it; of 176 frames in which a hand
is before the mouth, 114 fall below, and all but a few of the others are near these in time."""

AROUND_SECONDS = 0.5
"""Hands come and go: frames so near to one in which the mouth is covered are not trusted."""

GAP_SECONDS = 2.0
"""A hand that is there before and after so short a time was there all the while."""

MIN_PICTURES = 12
"""What is usual cannot be told from fewer pictures."""

_WIDTH = 72
_DARK = 8.0
"""Added to colours before their logarithm is taken, so that noise in the dark counts little."""


class LipContrast:
    """How the lips differ in colour from the skin, in four quarters, picture after picture.

    A covered mouth shows skin, or nothing like lips, where the detector still puts the lips. Brows
    and eyes tell nothing like it: they are lost where the detector errs, too, or where they close.

    Args:
        layout: a layout without lips is told nothing of: no mouth is ever covered.
    """

    def __init__(self, layout: FeatureLayout) -> None:
        low = layout.template.min(axis=0)
        places = (layout.template - low) * _WIDTH + 1
        width, height = np.ceil(places.max(axis=0)).astype(int) + 1
        self._layout = layout
        self._raster = rasterize(
            places, np.ones(len(places)), layout.face_triangles, int(width), int(height)
        )
        self._quarters = [
            _filled(places, rows, self._raster.mask) for rows in _outlines(layout.names)
        ]
        self._seen: list[Array] = []

    def __call__(self, pixels: UInt8[Array, "h w 3"], landmarks: Float[Array, "478 2"]) -> None:
        """Take in a picture."""
        points = self._layout.from_landmarks(landmarks)
        low = np.maximum(points.min(axis=0) - 2, 0).astype(int)
        high = np.ceil(np.maximum(points.max(axis=0), low) + 3).astype(int)
        crop = np.ascontiguousarray(pixels[low[1] : high[1], low[0] : high[0]])
        if not crop.size:
            self._seen.append(np.full((len(self._quarters), 3), np.nan))
            return
        small = shrunk(crop, 2 * _WIDTH)
        scale = np.array(small.shape[1::-1]) / crop.shape[1::-1]
        face = warp_to_raster(
            small, (points - low) * scale, self._layout.face_triangles, self._raster
        )
        logs = np.log(face.astype(np.float32) + _DARK)
        skin = np.median(logs[self._raster.mask], axis=0)
        contrasts = [logs[quarter].mean(axis=0) - skin for quarter in self._quarters]
        self._seen.append(np.array(contrasts).reshape(-1, 3))

    def covered(self, seconds: Float[Array, " N"] | None = None) -> Bool[Array, " N"]:
        """Of all pictures so far, those whose mouth is covered, as far as the lips tell.

        Args:
            seconds: when each was taken, of a video.
        """
        seen = np.array(self._seen)
        if len(seen) < MIN_PICTURES or not seen.size:
            return np.zeros(len(seen), bool)
        usual = np.nanmedian(seen, axis=0)
        kept = (seen * usual).sum(axis=2) / np.maximum((usual**2).sum(axis=1), 1e-9)
        bare: Array = (kept < MIN_CONTRAST).any(axis=1)
        if seconds is None or not bare.any():
            return bare
        return _near(seconds, np.sort(seconds[bare]))


def _near(seconds: Float[Array, " N"], times: Float[Array, " c"]) -> Bool[Array, " N"]:
    """Which moments are near to any of these times, or in a short gap between two of them."""
    padded = np.concatenate([[-np.inf], times, [np.inf]])
    after = np.searchsorted(times, seconds) + 1
    wait, since = padded[after] - seconds, seconds - padded[after - 1]
    return (np.minimum(wait, since) <= AROUND_SECONDS) | (wait + since <= GAP_SECONDS)


def _outlines(names: tuple[str, ...]) -> list[list[int]]:
    """Indices of the points around the right and left half of each lip; none without lips."""
    outlines = [
        [
            f"{lip}_lip_outer",
            *(f"{side}_{lip}_lip_outer.{step}" for step in (0, 1, 2)),
            f"{side}_mouth_corner",
            f"{side}_inner_mouth_corner",
            *(f"{side}_{lip}_lip_inner.{step}" for step in (1, 0)),
            f"{lip}_lip_inner",
        ]
        for lip in ("upper", "lower")
        for side in ("right", "left")
    ]
    if not all(name in names for outline in outlines for name in outline):
        return []
    return [[names.index(name) for name in outline] for outline in outlines]


def _filled(
    places: Float[Array, "n 2"], rows: list[int], mask: Bool[Array, "h w"]
) -> Bool[Array, "h w"]:
    import cv2

    drawn = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(drawn, [np.round((places[rows] - 0.5) * 16).astype(np.int32)], 1, shift=4)
    return (drawn > 0) & mask
