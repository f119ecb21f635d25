"""Pictures in which something, most often a hand, is before the mouth."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.feature_points import FeatureLayout
from mien.capture.images.photos import downscale
from mien.numeric.raster.rasterizer import rasterize
from mien.synthesis.composition.example_warping import warp_to_raster

__all__ = ["LipContrast"]

MIN_CONTRAST = 0.1
"""Least projection of the lips' contrast to the skin onto its median, relative to it. On seven
clips without hands (3958 frames) no quarter of the lips ever has less than 0.13; of 176 frames in
which a hand is before the mouth, 114 fall below, and all but a few of the others are near these in
time."""

AROUND_SECONDS = 0.5
"""Hands move: frames so near to one with an occluded mouth are taken for occluded."""

GAP_SECONDS = 2.0
"""Likewise the frames between two of them that are no farther apart."""

MIN_PICTURES = 12
"""From fewer the median contrast is unreliable."""

_WIDTH = 72
_DARK = 8.0
"""Added to colours before their logarithm is taken, so that noise in the dark counts little."""


class LipContrast:
    """Difference in colour of the lips from the skin, in four quarters, picture after picture.

    In a picture of an occluded mouth, skin or something else is where the detector puts the lips.
    Brows and eyes are no such cue: they lose contrast also where the detector errs, and in blinks.

    Args:
        layout: of the points; without lips no mouth is ever occluded.
    """

    def __init__(self, layout: FeatureLayout) -> None:
        low = layout.template.min(axis=0)
        points = (layout.template - low) * _WIDTH + 1
        width, height = np.ceil(points.max(axis=0)).astype(int) + 1
        self._layout = layout
        self._raster = rasterize(
            points, np.ones(len(points)), layout.face_triangles, int(width), int(height)
        )
        self._quarters = [
            _polygon_mask(points[rows], self._raster.mask) for rows in _lip_outlines(layout.names)
        ]
        self._contrasts: list[Array] = []

    def __call__(self, pixels: UInt8[Array, "h w 3"], landmarks: Float[Array, "478 2"]) -> None:
        """Measure and keep the contrast of a picture.

        Args:
            pixels: (h, w, 3) sRGB.
            landmarks: (478, 2) px.
        """
        points = self._layout.from_landmarks(landmarks)
        low = np.maximum(points.min(axis=0) - 2, 0).astype(int)
        high = np.ceil(np.maximum(points.max(axis=0), low) + 3).astype(int)
        crop = np.ascontiguousarray(pixels[low[1] : high[1], low[0] : high[0]])
        if not crop.size:
            self._contrasts.append(np.full((len(self._quarters), 3), np.nan))
            return
        small = downscale(crop, 2 * _WIDTH)
        scale = np.array(small.shape[1::-1]) / crop.shape[1::-1]
        triangles = self._layout.face_triangles
        face = warp_to_raster(small, (points - low) * scale, triangles, self._raster)
        logs = np.log(face.astype(np.float32) + _DARK)
        skin = np.median(logs[self._raster.mask], axis=0)
        contrasts = [logs[quarter].mean(axis=0) - skin for quarter in self._quarters]
        self._contrasts.append(np.array(contrasts).reshape(-1, 3))

    def occluded(self, seconds: Float[Array, " N"] | None = None) -> Bool[Array, " N"]:
        """Whether the mouth is occluded, of each picture so far.

        Args:
            seconds: when each was taken, of a video.
        """
        contrasts = np.array(self._contrasts)
        if len(contrasts) < MIN_PICTURES or not contrasts.size:
            return np.zeros(len(contrasts), bool)
        median = np.nanmedian(contrasts, axis=0)
        projected = (contrasts * median).sum(axis=2) / np.maximum((median**2).sum(axis=1), 1e-9)
        low: Array = (projected < MIN_CONTRAST).any(axis=1)
        if seconds is None or not low.any():
            return low
        return _near(seconds, np.sort(seconds[low]))


def _near(seconds: Float[Array, " N"], times: Float[Array, " c"]) -> Bool[Array, " N"]:
    """Which moments are near to any of these times, or in a short gap between two of them."""
    padded = np.concatenate([[-np.inf], times, [np.inf]])
    after = np.searchsorted(times, seconds) + 1
    until, since = padded[after] - seconds, seconds - padded[after - 1]
    return (np.minimum(until, since) <= AROUND_SECONDS) | (until + since <= GAP_SECONDS)


def _lip_outlines(names: tuple[str, ...]) -> list[list[int]]:
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


def _polygon_mask(corners: Float[Array, "k 2"], mask: Bool[Array, "h w"]) -> Bool[Array, "h w"]:
    """The pixels of a mask inside a polygon."""
    import cv2

    filled = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(filled, [np.round((corners - 0.5) * 16).astype(np.int32)], 1, shift=4)
    return (filled > 0) & mask
