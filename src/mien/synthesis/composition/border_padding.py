"""A photo continued beyond its edges, unobtrusively."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, UInt8

__all__ = ["pad_with_blurred_border"]

_MARGIN = 0.25
"""Of the photo's longer side. Farther out colours hardly differ and are repeated."""
_BLUR = 0.5
"""Standard deviation of the blur, in distances from the edge."""


def pad_with_blurred_border(photo: UInt8[Array, "h w 3"]) -> tuple[UInt8[Array, "k l 3"], int]:
    """A photo with its edge repeated around it, more blurred with the distance.

    Merely repeated pixels of the edge are stripes: under shoulders, over a hairdo. Here they are
    blurred along the edge, more the farther out, and not at all beside the photo.

    Args:
        photo: (h, w, 3) sRGB.

    Returns:
        the larger picture; how many px were added on each side.
    """
    height, width = photo.shape[:2]
    margin = int(np.ceil(_MARGIN * max(height, width)))
    levels = _blurred(_edge(photo), levels=int(np.ceil(np.log2(1 + margin))) + 1)
    larger = np.empty((height + 2 * margin, width + 2 * margin, 3), np.uint8)
    inner = slice(margin, margin + height), slice(margin, margin + width)
    larger[inner] = photo
    rows, columns = np.arange(-margin, height + margin), np.arange(-margin, width + margin)
    before, after = slice(margin), (slice(margin + height, None), slice(margin + width, None))
    strips = [
        (before, slice(None)),
        (after[0], slice(None)),
        (inner[0], before),
        (inner[0], after[1]),
    ]
    for strip in strips:
        larger[strip] = _sampled(levels, rows[strip[0], None], columns[strip[1]], height, width)
    return larger, margin


def _edge(photo: UInt8[Array, "h w 3"]) -> UInt8[Array, "p 3"]:
    """All pixels along the edge, clockwise from the top-left corner; corners count twice."""
    return np.concatenate([photo[0], photo[:, -1], photo[-1, ::-1], photo[::-1, 0]])


def _blurred(edge: UInt8[Array, "p 3"], levels: int) -> Float[Array, "levels p 3"]:
    """The edge as it is 0, 1, 3, 7, ... px away; blurred as a closed line, across corners too."""
    deviations = _BLUR * (2.0 ** np.arange(levels) - 1)
    frequencies = np.fft.rfftfreq(len(edge))
    gains = np.exp(-2 * (np.pi * deviations[:, None] * frequencies) ** 2)
    blurred = np.fft.irfft(gains[..., None] * np.fft.rfft(edge, axis=0), len(edge), axis=1)
    return blurred.astype(np.float32)


def _sampled(
    levels: Float[Array, "levels p 3"],
    rows: Int[Array, "k 1"],
    columns: Int[Array, " l"],
    height: int,
    width: int,
) -> UInt8[Array, "k l 3"]:
    """Colours of px outside of the photo, from the nearest px of the blurred edges."""
    y, x = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    third_corner = width + height
    index = np.select(
        [rows < 0, columns >= width, rows >= height],
        [x + 0 * rows, width + y + 0 * columns, third_corner + width - 1 - x + 0 * rows],
        third_corner + width + height - 1 - y,
    )
    distance = np.maximum(np.abs(rows - y), np.abs(columns - x))
    level = np.log2(1 + distance).astype(np.float32)
    lower = level.astype(int)
    fraction = (level - lower)[..., None]
    upper = np.minimum(lower + 1, len(levels) - 1)
    mixed = levels[lower, index]
    mixed += fraction * (levels[upper, index] - mixed)
    return np.rint(mixed).clip(0, 255).astype(np.uint8)
