"""JPEG 2000 with more than 8 bits a sample, which Pillow decodes wrongly (white becomes black)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mien.capture.images.opening import UnreadSamplesError

if TYPE_CHECKING:
    from PIL.Image import Image

_HEAD = 1 << 16
_BEGIN = b"\xff\x4f\xff\x51"
_PRECISION = 42
"""Bytes from there to the first channel's bits a sample, less one; above them the sign."""


def eight_bits_if_deep(image: Image) -> Image | None:
    """The picture in mode RGB, if it is JPEG 2000 in colour of more than 8 bits; otherwise None.

    Raises:
        UnreadSamplesError: it has transparent parts, or is not read here.
    """
    import cv2
    from PIL import Image

    if image.format != "JPEG2000" or image.mode not in ("RGB", "RGBA"):
        return None
    path = Path(cast(Any, image).filename)
    if _bits(path) <= 8:
        return None
    if image.mode == "RGBA":
        raise UnreadSamplesError("more, with transparent parts, in JPEG 2000")
    how = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.fromfile(path, np.uint8), how)
    if pixels is None:
        raise UnreadSamplesError("more, in JPEG 2000")
    return Image.fromarray(np.ascontiguousarray(pixels[:, :, ::-1]))


def _bits(path: Path) -> int:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    begin = head.find(_BEGIN)
    place = begin + _PRECISION
    return (head[place] & 0x7F) + 1 if begin >= 0 and place < len(head) else 8
