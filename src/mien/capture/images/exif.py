"""Orientation and focal length from a photo's EXIF."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from PIL.Image import Image

FILM_DIAGONAL_MM = math.hypot(36, 24)
"""43.27 mm. CIPA DCG-001 and EXIF 2.3 compare the *diagonals* of sensor and 35 mm film."""

_HEIF_TURN, _HEIF_HEAD = "original_orientation", 1 << 16
_ORIENTATION, _EXIF_IFD = 0x0112, 0x8769
_FOCAL_LENGTH, _FOCAL_LENGTH_35MM = 0x920A, 0xA405
_PIXEL_X, _PIXEL_Y = 0xA002, 0xA003
_PLANE_X_RESOLUTION, _PLANE_UNIT = 0xA20E, 0xA210
_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_CROP_TOLERANCE = 0.01


def orientation(image: Image) -> int:
    """EXIF orientation still to be applied, 1 (upright) to 8; 1 when absent or senseless.

    The image's pixels must be loaded: some decoders turn them themselves then.
    """
    turn = image.getexif().get(_ORIENTATION, 1)
    if image.format == "HEIF":
        # Where the container states it, the pixels are turned already, and EXIF's is void.
        path = Path(cast(Any, image).filename)
        turn = 1 if _turned_by_container(path) else image.info.get(_HEIF_TURN) or 1
    return turn if turn in range(1, 9) else 1


def _turned_by_container(path: Path) -> bool:
    """Whether a HEIC names a turn or a mirror among the properties at its beginning."""
    with path.open("rb") as file:
        head = file.read(_HEIF_HEAD)
    return b"irot" in head or b"imir" in head


def focal_prior_px(image: Image) -> tuple[float | None, list[str]]:
    """Focal length in px of the file's own pixels, and notes.

    From the 35 mm equivalent (by the diagonal), else from the focal length in mm and the focal
    plane's resolution. None when the file states neither, or was visibly cropped since: its
    numbers are those of the picture before.
    """
    tags = image.getexif().get_ifd(_EXIF_IFD)
    width, height = image.size
    taken_width = _number(tags, _PIXEL_X) or width
    taken_height = _number(tags, _PIXEL_Y) or height
    focal = _from_film(tags, width, height) or _from_sensor(tags, width / taken_width)
    if focal is None:
        return None, []
    aspect = (max(width, height) / min(width, height)) / (
        max(taken_width, taken_height) / min(taken_width, taken_height)
    )
    if abs(math.log(aspect)) > _CROP_TOLERANCE:
        return None, ["cropped after it was taken: its focal length is not used"]
    in_diagonals = focal / math.hypot(width, height)
    if not 0.2 < in_diagonals < 50:
        return None, [f"states a senseless focal length ({focal:.0f} px): not used"]
    return focal, []


def _from_film(tags: Mapping[int, Any], width: int, height: int) -> float | None:
    equivalent = _number(tags, _FOCAL_LENGTH_35MM)
    return equivalent and equivalent / FILM_DIAGONAL_MM * math.hypot(width, height)


def _from_sensor(tags: Mapping[int, Any], resized: float) -> float | None:
    focal_mm = _number(tags, _FOCAL_LENGTH)
    resolution = _number(tags, _PLANE_X_RESOLUTION)
    mm_per_unit = _MM_PER_UNIT.get(tags.get(_PLANE_UNIT, 2))
    if not (focal_mm and resolution and mm_per_unit):
        return None
    return focal_mm * resolution / mm_per_unit * resized


def _number(tags: Mapping[int, Any], tag: int) -> float | None:
    """A positive finite number, or None: cameras write 0, text and 0/0 for what they don't know."""
    try:
        value = float(tags[tag])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and value > 0 else None
