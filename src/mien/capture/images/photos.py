"""Photos of any common kind as upright 8-bit sRGB."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, UInt8, check_image, check_positive, frozen
from mien.capture.images.colour import convert_to_srgb, to_eight_bits, tone_map_hdr
from mien.capture.images.exif import focal_prior_px, orientation
from mien.capture.images.jpeg2000 import eight_bits_if_deep
from mien.capture.images.opening import open_image
from mien.reading.names import check_path, portable_name

if TYPE_CHECKING:
    from PIL.Image import Image

DEFAULT_MAX_SIDE = 4096
"""Longest side, in px, of a photo in memory unless the caller says otherwise."""

_JPEG = (".jpg", ".jpeg", ".jpe", ".jfif", ".mpo")
_JPEG_2000 = (".jp2", ".jpf", ".jpx", ".j2k", ".j2c", ".jpc")
_OTHER = (".png", ".tif", ".tiff", ".webp", ".bmp", ".dib", ".gif", ".ppm", ".pgm", ".pbm", ".pnm")
_HEIF = (".heic", ".heif", ".hif", ".avif")
PHOTO_SUFFIXES = frozenset((*_JPEG, *_JPEG_2000, *_HEIF, *_OTHER))
"""Endings (lower case) of the files of a folder that are photos."""


@dataclass(frozen=True)
class Photo:
    """One picture, upright, sRGB.

    Attributes:
        name: file name with its ending; unique within one expression of a capture.
        path: the file it came from (for a frame of a video, the video).
        pixels: (H, W, 3) uint8 sRGB after orientation, read-only.
        focal_prior_px: focal length that the file states, in px of `pixels`, or None.
        original_size: (width, height) in px after orientation, before any downscaling.
        notes: what was done to the picture, for its owner.
    """

    name: str
    path: Path
    pixels: UInt8[Array, "h w 3"]
    focal_prior_px: float | None = None
    original_size: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", frozen(check_image(self.name, self.pixels)))
        if self.original_size is None:
            object.__setattr__(self, "original_size", self.size)

    @property
    def stem(self) -> str:
        """The name without its ending, by which annotations are found."""
        return Path(self.name).stem

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of `pixels`."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def scale(self) -> float:
        """Pixels in memory per pixel of the original, along the longer side."""
        assert self.original_size is not None
        return max(self.size) / max(self.original_size)


def load_photo(path: str | Path, *, max_side: int = DEFAULT_MAX_SIDE) -> Photo:
    """A photo, turned upright, converted to 8-bit sRGB, at most `max_side` px long.

    Nothing is ever held as floating point, and a JPEG that will be shrunk is decoded at a reduced
    size, so that photos of 100 megapixels need no more memory than their own bytes.

    Args:
        path: JPEG, PNG, TIFF, WebP, BMP, HEIC, AVIF, GIF, JPEG 2000 or PPM, whatever its name.
        max_side: limit in px on the longer side.

    Raises:
        InputError: there is no such file, it may not be read, `max_side` is not positive.
        FileFormatError: not an image, empty, damaged, too large, of an unsupported sample type.
    """
    path = check_path("photo", path, "a photo")
    check_positive("max_side", max_side)
    notes: list[str] = []
    with open_image(path, notes) as image:
        original = image.size
        focal_per_px, focal_note = focal_prior_px(image)
        notes += focal_note
        small = _shrunk_rgb(image, max_side, notes)
        # After the pixels are decoded: some decoders turn them and report it only then.
        turn = orientation(image)
        upright = _turned(small, turn)
        pixels = np.asarray(upright)
    if turn in (5, 6, 7, 8):
        original = original[::-1]
    scale = max(pixels.shape[:2]) / max(original)
    if scale < 1:
        notes.append(f"scaled from {original[0]}x{original[1]} to {upright.width}x{upright.height}")
    focal = None if focal_per_px is None else focal_per_px * scale
    return Photo(portable_name(path), path, pixels, focal, original, tuple(notes))


def downscale(pixels: UInt8[Array, "h w 3"], side: int) -> UInt8[Array, "h w 3"]:
    """The picture at most `side` px long, by averaging; the same array when it is that already."""
    import cv2

    height, width = pixels.shape[:2]
    factor = side / max(height, width)
    if factor >= 1:
        return pixels
    size = max(1, round(width * factor)), max(1, round(height * factor))
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def _shrunk_rgb(image: Image, max_side: int, notes: list[str]) -> Image:
    """Decoded as sRGB, the longer side at most `max_side`.

    Shrinking comes before the colour conversion wherever the samples may be averaged, as the full
    picture is then held only once.
    """
    from PIL import Image

    factor = min(1.0, max_side / max(image.size))
    target = max(1, round(image.width * factor)), max(1, round(image.height * factor))
    if factor < 1:
        image.draft(None, target)
    # A phone's MPO holds its preview or gain map beside the photo: no news.
    if getattr(image, "n_frames", 1) > 1 and image.format != "MPO":
        notes.append(f"holds {getattr(image, 'n_frames', 1)} pictures: the first is used")
    image.load()
    profile, coded = image.info.get("icc_profile"), image.info.get("nclx_profile") or {}
    eight_bits = eight_bits_if_deep(image) or to_eight_bits(image, notes)
    if eight_bits.size != target and factor < 1:
        eight_bits = eight_bits.resize(target, Image.Resampling.LANCZOS, reducing_gap=2.0)
    return tone_map_hdr(
        convert_to_srgb(eight_bits, profile, notes), {} if profile else coded, notes
    )


def _turned(image: Image, turn: int) -> Image:
    """The picture with EXIF orientation 1 to 8 applied."""
    from PIL.Image import Transpose

    method = {
        2: Transpose.FLIP_LEFT_RIGHT,
        3: Transpose.ROTATE_180,
        4: Transpose.FLIP_TOP_BOTTOM,
        5: Transpose.TRANSPOSE,
        6: Transpose.ROTATE_270,
        7: Transpose.TRANSVERSE,
        8: Transpose.ROTATE_90,
    }.get(turn)
    return image if method is None else image.transpose(method)
