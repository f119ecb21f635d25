"""A frame as the tracker sees it: cut out around the face, at several sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera

_MARGIN = 0.15
"""Of the face's extent, on every side: as far as it may move between two frames."""
BRIGHTEST = 253
"""Of a colour that is certain not to be cut off."""


@dataclass(frozen=True)
class View:
    """One size of the cut-out.

    Attributes:
        pixels: (h, w, 3) float32, 0 to 255.
        inside: (h, w) float32, 1 where the frame has a pixel that tells how bright the face is.
        focal: px of this size; the principal point from the cut-out's corner.
        cx: px of this size; the principal point from the cut-out's corner.
        cy: px of this size; the principal point from the cut-out's corner.
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
        face_px: extent at which a face is compared, give or take a factor of sqrt(2); a smaller one
            stays as it is.
        levels: how many sizes.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    halvings = _halvings(extent, face_px)
    margin = _MARGIN * extent
    # So that every level is a whole number of pixels, always the same ones.
    multiple = 2 ** (halvings + levels - 1)
    origin = np.floor((low - margin) / multiple).astype(int) * multiple
    side = np.ceil((high + margin - origin) / multiple).astype(int) * multiple
    cut, inside = _cut(pixels, origin, side)
    views = []
    for level in range(levels):
        scale = 0.5 ** (halvings + level)
        cx, cy = (camera.principal - origin) * scale
        size = (round(side[0] * scale), round(side[1] * scale))
        cut, inside = _reduced(cut, size), _reduced(inside, size)
        focal = camera.focal_px * scale
        views.append(View(cut, inside, focal, float(cx), float(cy)))
    return views


def _halvings(extent: float, wanted: float) -> int:
    """How often to halve an extent until it is at most sqrt(2) times the one wanted.

    A scale that followed the face would move every pixel's grid, and one that is no whole number
    of pixels would blur unevenly.
    """
    return max(0, math.ceil(math.log2(max(extent, 1.0) / wanted) - 0.5))


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
    told = cv2.inRange(part, (0, 0, 0), (BRIGHTEST,) * 3)
    cut = cv2.copyMakeBorder(part, *around, cv2.BORDER_REPLICATE)
    inside = cv2.copyMakeBorder(told, *around, cv2.BORDER_CONSTANT, value=0)
    return cut.astype(np.float32), inside.astype(np.float32) / 255


def _reduced(image: Array, size: tuple[int, int]) -> Array:
    import cv2

    if (image.shape[1], image.shape[0]) == size:
        return image
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)
