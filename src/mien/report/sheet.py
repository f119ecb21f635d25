"""Pictures side by side, row after row."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, UInt8

_GAP = 4


def arrange_grid(cells: list[UInt8[Array, "h w 3"]], columns: int) -> UInt8[Array, "h w 3"]:
    """Cells of one size in rows on a white sheet."""
    height, width, _ = cells[0].shape
    columns = min(columns, len(cells))
    rows = -(-len(cells) // columns)
    size = (rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3)
    sheet = np.full(size, 255, np.uint8)
    for index, cell in enumerate(cells):
        row, column = divmod(index, columns)
        top, left = row * (height + _GAP), column * (width + _GAP)
        sheet[top : top + height, left : left + width] = cell
    return sheet
