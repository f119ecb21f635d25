"""A frame as the tracker sees it: cut out around the face, at several sizes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera

_MARGIN = 0.3
"""Of the face's extent, on every side: as far as it may move between two frames."""
_STEPS = [Fraction(part, 4 * 2**n) for n in range(5) for part in (4, 3)]
"""Scales: few and fixed, for one that followed the face would move every pixel's grid."""
_BRIGHTEST = 253
"""Of a colour that is certain not to be cut off."""


@dataclass(frozen=True)
class View:
    """One size of the cut-out.

    Attributes:
        pixels: (h, w, 3) float32, 0 to 255.
        inside: (h, w) float32, 1 where the frame has a pixel that tells how bright the face is.
        focal, cx, cy: px of this size; the principal point from the cut-out's corner.
    """

    pixels: Float[Array, "h w 3"]
    inside: Float[Array, "h w"]
    focal: float
    cx: float
    cy: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.pixels.shape[1], self.pixels.shape[0]


def cut_views(
    pixels: UInt8[Array, "h w 3"],
    camera: Camera,
    points: Float[Array, "n 2"],
    *,
    face_px: float,
    levels: int,
) -> list[View]:
    """The part of a frame around a face, the finest size first, each half of that before.

    Args:
        camera: of the frame's own pixels.
        points: (N, 2) px where the face is thought to be.
        face_px: width at which a face is compared; a smaller one stays as it is.
        levels: how many sizes.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    factor = _scale(face_px / max(extent, 1.0))
    margin = _MARGIN * extent
    # So that every level is a whole number of pixels, always the same ones.
    multiple = factor.denominator * 2 ** (levels - 1)
    origin = np.floor((low - margin) / multiple).astype(int) * multiple
    side = np.ceil((high + margin - origin) / multiple).astype(int) * multiple
    cut, inside = _cut(pixels, origin, side)
    views = []
    for level in range(levels):
        scale = float(factor) / 2**level
        cx, cy = (camera.principal - origin) * scale
        size = (round(side[0] * scale), round(side[1] * scale))
        cut, inside = _reduced(cut, size), _reduced(inside, size)
        focal = camera.focal_px * scale
        views.append(View(np.float32(cut), np.float32(inside), focal, float(cx), float(cy)))
    return views


def _scale(wanted: float) -> Fraction:
    """The greatest step that is not more than an eighth above what is wanted."""
    return next((step for step in _STEPS if step <= 1.125 * wanted), _STEPS[-1])


def _cut(pixels: Array, origin: Array, side: Array) -> tuple[Array, Array]:
    """The part of the frame, its last pixels repeated beyond its borders, and where it tells.

    Beyond the borders it does not, nor where a colour is as bright as it can be: how bright the
    face is there is not known.
    """
    import cv2

    height, width = pixels.shape[:2]
    low = np.clip(origin, 0, [width - 1, height - 1])
    high = np.clip(origin + side, low + 1, [width, height])
    part = pixels[low[1] : high[1], low[0] : high[0]]
    before, after = low - origin, origin + side - high
    around = (before[1], after[1], before[0], after[0])
    told = cv2.inRange(part, (0, 0, 0), (_BRIGHTEST,) * 3)
    cut = cv2.copyMakeBorder(part, *around, cv2.BORDER_REPLICATE)
    inside = cv2.copyMakeBorder(told, *around, cv2.BORDER_CONSTANT, value=0)
    return np.float32(cut), np.float32(inside) / 255


def _reduced(image: Array, size: tuple[int, int]) -> Array:
    import cv2

    if (image.shape[1], image.shape[0]) == size:
        return image
    reduced: Array = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return reduced
