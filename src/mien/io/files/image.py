"""Pictures to and from files."""

from __future__ import annotations

import io
from contextlib import suppress
from pathlib import Path

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.images.colour import to_eight_bits
from mien.capture.images.opening import open_image
from mien.errors import FileFormatError, InputError
from mien.io.files.atomic import atomic_file
from mien.reading.files import is_missing

_KINDS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}
_MODES = {3: "RGB", 4: "RGBA"}
_SOFTWARE = "mien"
"""In every PNG, under the keyword that the standard has for it."""


def image_kind(path: str | Path) -> str:
    """The kind of a picture, "PNG" or "JPEG", by suffix. Raises: InputError: any other."""
    suffix = Path(path).suffix.lower()
    if suffix not in _KINDS:
        raise InputError(path, f"a name that ends in {', '.join(_KINDS)}", suffix or "no suffix")
    return _KINDS[suffix]


def save_image(path: str | Path, pixels: UInt8[Array, "h w c"], *, quality: int = 95) -> None:
    """Write a picture, whole or not at all; the suffix tells the kind.

    Args:
        path: .png, .jpg or .jpeg.
        pixels: (h, w, 3) sRGB or (h, w, 4) with alpha last, not premultiplied.
        quality: of a JPEG, 1 to 100.

    Raises:
        InputError: an unknown suffix, transparency into a JPEG, a place that cannot be written.
    """
    kind = image_kind(path)
    if kind == "JPEG" and pixels.ndim == 3 and pixels.shape[2] == 4:
        if pixels[..., 3].min(initial=255) < 255:
            raise InputError(path, "a .png for a picture with transparency", Path(path).suffix)
        pixels = pixels[..., :3]
    data = encode_image(pixels, kind, quality=quality)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def encode_image(pixels: UInt8[Array, "h w c"], kind: str, *, quality: int = 95) -> bytes:
    """The bytes of a "PNG" or "JPEG" file; the same pixels give the same bytes.

    JPEGs keep full colour resolution: halved chroma bleeds the lips into the skin around them.
    """
    from PIL import Image

    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] not in _MODES:
        raise InputError(
            "pixels", "an (h, w, 3 or 4) uint8 image", f"shape {pixels.shape}, {pixels.dtype}"
        )
    stream = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels))
    if kind == "JPEG":
        image.save(stream, "JPEG", quality=quality, subsampling=0, optimize=True)
    else:
        from PIL.PngImagePlugin import PngInfo

        info = PngInfo()
        info.add_text("Software", _SOFTWARE)
        # A fifth of the time that the default level takes, for a tenth more bytes of a photograph.
        image.save(stream, "PNG", compress_level=1, pnginfo=info)
    return stream.getvalue()


def is_png_by_mien(path: Path) -> bool:
    """Whether a file is a PNG that encode_image made, and no program has written since."""
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                return b"tEXtSoftware\0" + _SOFTWARE.encode() in file.read(128)
    return False


def load_image(path: str | Path) -> UInt8[Array, "h w 3"]:
    """An image that mien wrote, or that was painted in place of one, as (h, w, 3) sRGB.

    Photos of any other origin are read by `mien.capture`.

    Raises:
        FileFormatError: missing, not a file, not such an image.
    """
    try:
        with open_image(path, [], kind="an image") as image:
            image.load()
            # Pillow's own conversion of 16 bits cuts them off at 255.
            eight_bits = to_eight_bits(image, []) if image.mode.startswith("I") else image
            return np.asarray(eight_bits.convert("RGB"))
    except InputError as error:
        found = f"expected {error.expected}, found {error.got}"
        problem = "there is no such file" if is_missing(path) else found
        raise FileFormatError(path, problem) from None
