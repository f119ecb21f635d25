"""Opening image files: the kinds that are read, and errors in one line."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from mien.capture.images.unsupported import unsupported_kind
from mien.errors import FileFormatError, InputError, one_line
from mien.reading.files import check_readable, describe_content

if TYPE_CHECKING:
    from PIL.Image import Image

MAX_PIXELS = 175_000_000
"""Larger pictures are refused before any pixel is decoded (Pillow's own limit is 179 MP)."""

FORMATS = (
    "JPEG",
    "PNG",
    "TIFF",
    "WEBP",
    "BMP",
    "GIF",
    "JPEG2000",
    "PPM",
    "HEIF",
    "AVIF",
)
"""Pillow's names of the formats that are read. Pillow has others, and for some, as PostScript, it
starts a program that runs the file's code."""

_EXPECTED = "an image (JPEG, PNG, HEIC, ...)"


class UnreadSamplesError(ValueError):
    """A whole image whose samples are of a kind that is not read."""


@contextmanager
def open_image(path: str | Path, notes: list[str], *, kind: str = "a photo") -> Iterator[Image]:
    """The file as a Pillow image; whatever goes wrong while it is open becomes one clear line.

    Args:
        path: the file.
        notes: gains the decoder's warnings.
        kind: what the file should be, for messages.

    Raises:
        InputError: there is no such file, it is a pipe, a device or a folder, or may not be read.
        FileFormatError: not an image of a kind that is read, empty, damaged, too large.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    check_readable(path, kind)
    with warnings.catch_warnings(record=True) as caught:
        # Pillow warns about damaged metadata and large pictures; the first is worth a note.
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with Image.open(path, formats=_formats()) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise _too_large(path, f"{image.width}x{image.height}")
                # Cameras wrap their RAW files as TIFFs of the preview.
                if image.format == "TIFF" and unsupported_kind(path):
                    raise UnidentifiedImageError
                yield image
        except FileFormatError:
            raise
        except Image.DecompressionBombError:
            raise _too_large(path, "more") from None
        except UnidentifiedImageError:
            found = unsupported_kind(path) or describe_content(path)
            raise FileFormatError(path, f"expected {_EXPECTED}, found {found}") from None
        except UnreadSamplesError as error:
            raise FileFormatError(path, f"expected 8 or 16 bits a sample, found {error}") from None
        except Exception as error:
            # Decoders raise whatever a damaged byte leads them to.
            problem = f"expected a whole image, found a damaged one ({one_line(error)})"
            raise FileFormatError(path, problem) from error
    notes += [f"odd file: {one_line(warning.message)}" for warning in caught]


def is_image(path: Path) -> bool:
    """Whether the file begins like a still image; an animated one is a clip."""
    try:
        with open_image(path, []) as image:
            animated = image.format in ("GIF", "PNG") and getattr(image, "n_frames", 1) > 1
            return not animated
    except FileFormatError as error:
        return _EXPECTED not in error.problem
    except InputError:
        return False


@cache
def _formats() -> list[str]:
    """Those of `FORMATS` that this Pillow can read; knowing AVIF depends on its version."""
    import pillow_heif
    from PIL import Image

    pillow_heif.register_heif_opener()
    Image.init()
    return [name for name in FORMATS if name in Image.OPEN]


def _too_large(path: Path, found: str) -> FileFormatError:
    limit = f"{MAX_PIXELS // 1_000_000} megapixels"
    return FileFormatError(path, f"expected at most {limit}, found {found}")
