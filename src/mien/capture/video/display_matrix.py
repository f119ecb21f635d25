"""A clip's display matrix: how its stored pictures are turned and mirrored to be shown."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from mien.arrays import Array, Int, UInt8

if TYPE_CHECKING:
    from av import VideoFrame

_QUARTER = np.array([[0, -1], [1, 0]])
"""A quarter turn counterclockwise."""


@dataclass(frozen=True)
class DisplayTransform:
    """Quarter turns and flips.

    Attributes:
        transposed: rows become columns, before anything else.
        flip_x: then mirrored from left to right.
        flip_y: then mirrored from top to bottom.
    """

    transposed: bool = False
    flip_x: bool = False
    flip_y: bool = False

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Width and height after the transform, from those of the stored picture."""
        return (height, width) if self.transposed else (width, height)

    def apply(self, stored: UInt8[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
        """The picture as it is to be shown."""
        shown = stored.transpose(1, 0, 2) if self.transposed else stored
        shown = shown[:, ::-1] if self.flip_x else shown
        return np.ascontiguousarray(shown[::-1] if self.flip_y else shown)

    def turned(self, quarters: int) -> DisplayTransform:
        """The same, and turned by so many quarters counterclockwise."""
        return _of(self._matrix @ np.linalg.matrix_power(_QUARTER, quarters % 4))

    @property
    def _matrix(self) -> Int[Array, "2 2"]:
        """The directions that right and down of the stored picture become, a row each."""
        x, y = (-1 if self.flip_x else 1), (-1 if self.flip_y else 1)
        return np.array([[0, y], [x, 0]] if self.transposed else [[x, 0], [0, y]])


def display_transform(frame: VideoFrame) -> DisplayTransform:
    """The nearest to the container's display matrix; none without one."""
    data: Any = frame.side_data.get("DISPLAYMATRIX")
    if data is None:
        return DisplayTransform()
    return _of(np.frombuffer(data, np.int32)[:6].reshape(2, 3)[:, :2])


def _of(matrix: Int[Array, "2 2"]) -> DisplayTransform:
    choices = [DisplayTransform(*flags) for flags in product((False, True), repeat=3)]
    return max(choices, key=lambda choice: float(np.sum(choice._matrix * matrix.astype(float))))
