"""A contact sheet of examples: each one's face, its name, and why it was chosen."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

import numpy as np

from mien.arrays import Array, UInt8
from mien.report.sheet import arrange_grid
from mien.report.track.caption import draw_text
from mien.synthesis.examples.example_set import Example, ExampleSet

_CELL = (240, 300)
"""Width and height of a face, px."""
_MARGIN = 0.18
_LINE_LENGTH, _LINES, _FONT_SIZE = 34, 3, 13
_PAPER, _INK, _LIGHT_INK = 255, (20, 20, 24), (96, 98, 106)


def example_sheet(
    example_set: ExampleSet, why: Mapping[str, str], *, columns: int = 8
) -> UInt8[Array, "h w 3"]:
    """All examples in their order, cropped to the face.

    Args:
        example_set: of the person.
        why: each was chosen, by name.
        columns: of the sheet.
    """
    cells = []
    for index, example in enumerate(example_set.examples):
        reason = why.get(example.name, "") + ", shows teeth" * (index in example_set.teeth)
        cells.append(np.concatenate([_face(example), _caption(example.name, reason)]))
    return arrange_grid(cells, columns)


def _face(example: Example) -> UInt8[Array, "h w 3"]:
    """The photo around the points, as wide and high as a cell; edges repeated."""
    import cv2

    low, high = example.points.min(axis=0), example.points.max(axis=0)
    middle, extent = (low + high) / 2, (1 + 2 * _MARGIN) * (high - low)
    scale = float(min(_CELL / extent))
    matrix = np.array([[scale, 0, 0], [0, scale, 0]])
    # The centre of OpenCV's first pixel is 0, ours 0.5.
    matrix[:, 2] = np.array(_CELL) / 2 - 0.5 - scale * (middle - 0.5)
    interpolation = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return cv2.warpAffine(
        example.photo, matrix, _CELL, flags=interpolation, borderMode=cv2.BORDER_REPLICATE
    )


def _caption(name: str, reason: str) -> UInt8[Array, "h w 3"]:
    lines = [name, *textwrap.wrap(reason, _LINE_LENGTH)[:_LINES]]
    height = round(1.35 * _FONT_SIZE * (_LINES + 1)) + 6
    strip = np.full((height, _CELL[0], 3), _PAPER, np.uint8)
    for number, line in enumerate(lines):
        at = (0.5, (1.35 * _FONT_SIZE * (number + 0.5) + 3) / height)
        colour = _LIGHT_INK if number else _INK
        strip = draw_text(strip, line, colour, at=at, size=_FONT_SIZE)
    return strip
