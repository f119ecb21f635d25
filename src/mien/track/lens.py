"""Focal lengths: as users write them, and as numbers that are only partly known."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from mien.arrays import check_positive
from mien.capture.images.exif import FILM_DIAGONAL_MM
from mien.errors import InputError
from mien.head import Head
from mien.reconstruction.landmark_fit import FOCAL_PRIOR_DEVIATION, FOCAL_PRIOR_DIAGONALS

SAME_LENS_DEVIATION = 0.15
"""Of log focal length: a video in the shape of the head's own photos is likely of their camera."""
_SAME_SHAPE = 0.01
_WRITTEN = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(px|mm|deg)\s*")
_EXPECTED = (
    "a number with its unit: 1200px, 28mm (of 35 mm film), or 60deg (across the longer side)"
)


def parse_lens(text: str, width: int, height: int) -> float:
    """Focal length in px of a picture of this size, as `1200px`, `28mm` or `60deg` say.

    Millimetres are those of the lens that shows as much on 35 mm film, by the diagonal, as cameras
    state it; degrees are the angle of view across the picture's longer side.

    Raises:
        InputError: anything else, and what no lens is: 0, 180 degrees and more.
    """
    found = _WRITTEN.fullmatch(text)
    if found is None:
        raise InputError("lens", _EXPECTED, repr(text))
    number, unit = float(found[1]), found[2]
    if number == 0 or (unit == "deg" and number >= 180):
        raise InputError("lens", "more than 0, and less than 180deg", repr(text))
    if unit == "px":
        return number
    if unit == "mm":
        return number / FILM_DIAGONAL_MM * float(np.hypot(width, height))
    return max(width, height) / 2 / float(np.tan(np.radians(number) / 2))


@dataclass(frozen=True)
class LogFocal:
    """What is known of a focal length: its logarithm, normally distributed.

    Attributes:
        mean: log of px.
        precision: one over the variance of the logarithm.

    Raises:
        InputError: a precision that is not positive.
    """

    mean: float
    precision: float

    def __post_init__(self) -> None:
        check_positive("precision", self.precision)

    @property
    def focal_px(self) -> float:
        """The median."""
        return float(np.exp(self.mean))

    @property
    def deviation(self) -> float:
        """Standard deviation of the logarithm: 0.1 is about 10 %."""
        return float(self.precision**-0.5)


def expected_focal(head: Head, width: int, height: int) -> LogFocal:
    """What a video's focal length is likely to be before it is looked at.

    That of the head's own photos where they have the video's shape (upright or not), in diagonals
    of the picture; otherwise anything from a phone to a cropped portrait.
    """
    wanted = _elongation(width, height)
    cameras = [view.camera for view in head.views]
    alike = [
        camera.focal_px / np.hypot(camera.width, camera.height)
        for camera in cameras
        if abs(_elongation(camera.width, camera.height) - wanted) < _SAME_SHAPE
    ]
    diagonal = float(np.hypot(width, height))
    if alike:
        mean = float(np.mean(np.log(alike)))
        return LogFocal(mean + np.log(diagonal), SAME_LENS_DEVIATION**-2)
    return LogFocal(np.log(FOCAL_PRIOR_DIAGONALS * diagonal), FOCAL_PRIOR_DEVIATION**-2)


def _elongation(width: int, height: int) -> float:
    return abs(float(np.log(width / height)))
