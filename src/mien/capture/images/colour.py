"""Pillow images of every mode and colour profile as 8-bit sRGB."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mien.capture.images.opening import UnreadSamplesError

if TYPE_CHECKING:
    from PIL.Image import Image

_SPACE = slice(16, 20)
"""Bytes of a colour profile that name its colour space."""


def to_eight_bits(image: Image, notes: list[str]) -> Image:
    """The picture in mode L, RGB, CMYK or LAB: 8 bits a sample, no palette, no alpha.

    Raises:
        UnreadSamplesError: samples whose range is unknown (floating point, 32 bits).
    """
    from PIL import Image

    if image.mode in ("L", "RGB", "CMYK", "LAB"):
        return image
    if image.mode.startswith("I"):
        # 16-bit grey; 65535 is white, and 65535 / 257 is 255.
        samples = np.asarray(image)
        if samples.min() < 0 or samples.max() > 65535:
            raise UnreadSamplesError(f"values from {samples.min()} to {samples.max()}")
        notes.append("16-bit grey: reduced to 8 bits")
        return Image.fromarray((samples // 257).astype(np.uint8))
    if image.mode == "F":
        raise UnreadSamplesError("floating-point samples")
    if image.mode in ("RGBA", "RGBa", "LA", "La", "PA") or "transparency" in image.info:
        return _without_alpha(image, notes)
    return image.convert("L" if image.mode == "1" else "RGB")


def _without_alpha(image: Image, notes: list[str]) -> Image:
    """Composited onto white, as most viewers show it."""
    from PIL import Image

    # Grey stays grey, as its colour profile may be one of grey.
    colour = "L" if image.mode[0] == "L" else "RGB"
    rgba = image.convert("RGBA")
    if rgba.getchannel("A").getextrema()[0] == 255:
        return rgba.convert(colour)
    notes.append("transparent parts are shown on white")
    white = Image.new("RGBA", rgba.size, "white")
    white.alpha_composite(rgba)
    return white.convert(colour)


def convert_to_srgb(image: Image, profile: bytes | None, notes: list[str]) -> Image:
    """Mode RGB; samples converted to sRGB where the file's colour profile is another one."""
    from PIL import ImageCms

    if profile:
        try:
            source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
            name = ImageCms.getProfileDescription(source).strip()
            if "sRGB" not in name:
                if image.mode == "L" and profile[_SPACE] == b"RGB ":
                    image = image.convert("RGB")
                converted = ImageCms.profileToProfile(
                    image, source, ImageCms.createProfile("sRGB"), outputMode="RGB"
                )
                assert converted is not None
                notes.append(f"colours converted from {name or 'an unnamed profile'} to sRGB")
                return converted
        except (ImageCms.PyCMSError, OSError):
            notes.append("its colour profile is damaged or of another kind: taken as sRGB")
    elif image.mode == "CMYK":
        notes.append("CMYK without a colour profile: colours are approximate")
    return image if image.mode == "RGB" else image.convert("RGB")


def tone_map_hdr(image: Image, coded: Mapping[str, Any], notes: list[str]) -> Image:
    """Mode RGB; a picture coded in PQ or HLG, as some cameras' HEICs are, in sRGB.

    Args:
        image: in mode RGB.
        coded: the container's colour description, by the names of HEIF's `nclx` box.
        notes: gains one where the picture is HDR.
    """
    from mien.capture.images import hdr

    transfer = coded.get("transfer_characteristics")
    if transfer not in hdr.HDR:
        return image
    from PIL import Image

    notes.append(f"HDR photo ({hdr.HDR[transfer]}): its colours are mapped to sRGB")
    codes = np.asarray(image).astype(np.uint16) * 257
    return Image.fromarray(hdr.hdr_to_srgb(codes, transfer, coded.get("color_primaries", 0)))
