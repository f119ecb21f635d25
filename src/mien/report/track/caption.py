"""Words in pictures of tracked frames."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, UInt8
from mien.track.state import TrackedFrame

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Colour = tuple[int, int, int]
_BELOW: Colour = (24, 25, 29)
_PLAIN: Colour = (205, 207, 214)
# Told apart by those who cannot tell red from green, too: by brightness and by the words.
STATUS_COLOURS: dict[str, Colour] = {
    "ok": (120, 200, 255),
    "reacquired": (255, 200, 60),
    "lost": (255, 96, 64),
}
_COLUMNS = (0.6, 7.5, 13.0, 20.0, 28.0)
"""Where the words of a caption begin, in sizes of its letters: so that they stand still."""


def caption(found: TrackedFrame, width: int) -> UInt8[Array, "h w 3"]:
    """(h, width, 3): number, time and status of a frame, and how well it was explained."""
    from PIL import Image, ImageDraw

    size = _text_size(width)
    height = 2 * round(0.9 * size)
    strip = Image.new("RGB", (width, height), _BELOW)
    draw = ImageDraw.Draw(strip)
    words = [f"frame {found.frame}", f"{found.time:.2f} s", found.status.replace("lost", "LOST")]
    if found.state is not None:
        words += [f"error {found.rms:.1f} rms", f"{100 * found.seen:.0f} % seen"]
    for index, (left, word) in enumerate(zip(_COLUMNS, words, strict=False)):
        colour = STATUS_COLOURS[found.status] if index == 2 else _PLAIN
        draw.text((left * size, height / 2), word, colour, _font(size), anchor="lm")
    return np.asarray(strip)


def say_lost(picture: UInt8[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
    """The picture with LOST in its middle."""
    return write_on(picture, "LOST", STATUS_COLOURS["lost"], size=picture.shape[1] // 7)


def write_on(
    picture: UInt8[Array, "h w 3"],
    word: str,
    colour: Colour = _PLAIN,
    *,
    at: tuple[float, float] = (0.5, 0.5),
    size: int,
    outline: int = 0,
) -> UInt8[Array, "h w 3"]:
    """The picture with a word on it.

    Args:
        at: the word's middle, as shares of width and height.
        size: of the letters, px.
        outline: dark, so many px wide, where one does not know what is behind the word.
    """
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    image = Image.fromarray(picture)
    middle = (at[0] * width, at[1] * height)
    ImageDraw.Draw(image).text(
        middle,
        word,
        colour,
        _font(max(size, 6)),
        anchor="mm",
        stroke_width=outline,
        stroke_fill=_BELOW,
    )
    return np.asarray(image)


def _text_size(width: int) -> int:
    """Of a caption's letters, px: as large as has room, and no larger than one reads with ease."""
    return int(np.clip(width / 50, 6, 20))


@cache
def _font(size: int) -> FreeTypeFont:
    """The one that comes with Pillow, so that a caption looks the same everywhere."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font
