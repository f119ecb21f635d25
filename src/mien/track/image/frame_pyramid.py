"""Image pyramid of a frame, cropped around the face."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera

_MARGIN = 0.15
"""Of the face's extent, on every side: as far as it may move between two frames."""
BRIGHTEST = 253
"""Colour values above this may be saturated."""


class Intrinsics(NamedTuple):
    """Focal length and principal point, px."""

    focal: float
    cx: float
    cy: float


@dataclass(frozen=True)
class FrameCrop:
    """The part of a frame around the face, at one level of the pyramid.

    Attributes:
        pixels: (h, w, 3) float32, 0 to 255.
        valid: (h, w) float32, 1 where the frame has a pixel that is not saturated.
        focal: px of this level.
        cx: px of this level, the principal point from the crop's corner.
        cy: px of this level, the principal point from the crop's corner.
    """

    pixels: Float[Array, "h w 3"]
    valid: Float[Array, "h w"]
    focal: float
    cx: float
    cy: float

    def intrinsics(self, zoom: float) -> Intrinsics:
        """Of this level.

        Args:
            zoom: focal length over that of the crop, as Pose's.
        """
        return Intrinsics(float(self.focal * zoom), float(self.cx), float(self.cy))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.pixels.shape[1], self.pixels.shape[0]


def crop_pyramid(
    pixels: UInt8[Array, "h w 3"],
    camera: Camera,
    points: Float[Array, "n 2"],
    *,
    face_px: float,
    levels: int,
) -> list[FrameCrop]:
    """The part of a frame around a face, the finest level first, each half the size of the last.

    Args:
        pixels: of the whole frame.
        camera: of the frame's own pixels.
        points: (N, 2) px of the face, where it is expected.
        face_px: extent of the face in the finest level, within a factor of sqrt(2); a smaller face
            is not enlarged.
        levels: how many.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    halvings = _halvings(extent, face_px)
    margin = _MARGIN * extent
    # So that every level is a whole number of pixels, always the same ones.
    multiple = 2 ** (halvings + levels - 1)
    origin = np.floor((low - margin) / multiple).astype(int) * multiple
    side = np.ceil((high + margin - origin) / multiple).astype(int) * multiple
    part, valid = _crop(pixels, origin, side)
    crops = []
    for level in range(levels):
        scale = 0.5 ** (halvings + level)
        cx, cy = (camera.principal - origin) * scale
        size = (round(side[0] * scale), round(side[1] * scale))
        part, valid = _reduced(part, size), _reduced(valid, size)
        focal = camera.focal_px * scale
        crops.append(FrameCrop(part, valid, focal, float(cx), float(cy)))
    return crops


def _halvings(extent: float, wanted: float) -> int:
    """How often to halve an extent until it is at most sqrt(2) times the one wanted.

    A scale that follows the face would resample every frame on another grid.
    """
    return max(0, math.ceil(math.log2(max(extent, 1.0) / wanted) - 0.5))


def _crop(pixels: Array, origin: Array, side: Array) -> tuple[Array, Array]:
    """The part of the frame, its border pixels repeated beyond its borders, and a validity mask.

    Pixels beyond the borders and saturated ones are not valid.
    """
    import cv2

    height, width = pixels.shape[:2]
    low = np.clip(origin, 0, [width - 1, height - 1])
    high = np.clip(origin + side, low + 1, [width, height])
    part = pixels[low[1] : high[1], low[0] : high[0]]
    before, after = low - origin, origin + side - high
    around = (before[1], after[1], before[0], after[0])
    unsaturated = cv2.inRange(part, (0, 0, 0), (BRIGHTEST,) * 3)
    padded = cv2.copyMakeBorder(part, *around, cv2.BORDER_REPLICATE)
    valid = cv2.copyMakeBorder(unsaturated, *around, cv2.BORDER_CONSTANT, value=0)
    return padded.astype(np.float32), valid.astype(np.float32) / 255


def _reduced(image: Array, size: tuple[int, int]) -> Array:
    import cv2

    if (image.shape[1], image.shape[0]) == size:
        return image
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)
