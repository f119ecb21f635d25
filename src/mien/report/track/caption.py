"""Text in pictures of tracked frames."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, UInt8
from mien.track.state import TrackedFrame

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Colour = tuple[int, int, int]
_DARK: Colour = (24, 25, 29)
_LIGHT: Colour = (205, 207, 214)
# Distinguishable without seeing red and green, too: by brightness and by the words.
STATUS_COLOURS: dict[str, Colour] = {
    "ok": (120, 200, 255),
    "reacquired": (255, 200, 60),
    "lost": (255, 96, 64),
}
_COLUMNS = (0.6, 7.5, 13.0, 20.0, 28.0)
"""Where the words of a caption begin, in letter sizes: fixed, so that they do not move."""


def frame_caption(frame: TrackedFrame, width: int) -> UInt8[Array, "h w 3"]:
    """(h, width, 3): number, time and status of a frame, RMS error and visible share.

    Args:
        frame: that is described.
        width: of the picture, px.
    """
    from PIL import Image, ImageDraw

    size = _text_size(width)
    height = 2 * round(0.9 * size)
    strip = Image.new("RGB", (width, height), _DARK)
    draw = ImageDraw.Draw(strip)
    words = [f"frame {frame.frame}", f"{frame.time:.2f} s", frame.status.replace("lost", "LOST")]
    if frame.state is not None:
        words += [f"error {frame.rms:.1f} rms", f"{100 * frame.seen:.0f} % seen"]
    for index, (left, word) in enumerate(zip(_COLUMNS, words, strict=False)):
        colour = STATUS_COLOURS[frame.status] if index == 2 else _LIGHT
        draw.text((left * size, height / 2), word, colour, _font(size), anchor="lm")
    return np.asarray(strip)


def mark_lost(picture: UInt8[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
    """The picture with LOST in its middle."""
    return draw_text(picture, "LOST", STATUS_COLOURS["lost"], size=picture.shape[1] // 7)


def draw_text(
    picture: UInt8[Array, "h w 3"],
    word: str,
    colour: Colour = _LIGHT,
    *,
    at: tuple[float, float] = (0.5, 0.5),
    size: int,
    outline: int = 0,
) -> UInt8[Array, "h w 3"]:
    """The picture with a word on it.

    Args:
        picture: sRGB.
        word: that is drawn.
        colour: of the letters, sRGB.
        at: the word's middle, as shares of width and height.
        size: of the letters, px.
        outline: width of a dark outline, px, for pictures of any brightness.
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
        stroke_fill=_DARK,
    )
    return np.asarray(image)


def _text_size(width: int) -> int:
    """Size of a caption's letters, px, from 6 to 20."""
    return int(np.clip(width / 50, 6, 20))


@cache
def _font(size: int) -> FreeTypeFont:
    """Pillow's own font, so that a caption looks the same on every computer."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font
