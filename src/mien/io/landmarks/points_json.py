"""P.json: where some or all feature points of a layout are in a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError
from mien.io.files.atomic import atomic_file
from mien.reading.strict_json import JsonValue, errors_name_file, read_json, unknown_name

__all__ = ["load_points_json", "save_points_json"]

_KEYS = ("layout", "points")


def load_points_json(
    path: str | Path, layout: FeatureLayout, *, axes: int = 2
) -> dict[str, Float[Array, " d"]]:
    """The points in a file, by name, px: `{"layout": "zhang134", "points": {"NAME": [X, Y]}}`.

    Args:
        path: the file.
        layout: of the points.
        axes: 3 for points of a head: [X, Y, Z] mm, head space.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: not JSON, another layout's points, an unknown name (suggests the nearest),
            anything but so many finite numbers a point, no point at all; says where.
    """
    data = JsonValue(read_json(path))
    with errors_name_file(path):
        return _points(data, layout, axes)


def save_points_json(
    path: str | Path, layout: FeatureLayout, points: Mapping[str, Float[Array, " d"]]
) -> None:
    """Write some or all points of a layout, to a thousandth of a pixel or of a mm.

    Args:
        path: the file.
        layout: of the points.
        points: by name, two numbers each, or three each.

    Raises:
        InputError: a name that the layout does not have, shapes, NaN, the place.
    """
    rows = {}
    for name, point in points.items():
        layout.index(name)
        axes = 3 if np.size(point) == 3 else 2
        rows[name] = [round(float(number), 3) for number in check_array(name, point, (axes,))]
    if len({len(row) for row in rows.values()}) > 1:
        raise InputError("points", "two numbers for each, or three", "some of both")
    if not rows:
        raise InputError("points", "at least one", "none")
    lines = ",\n".join(f"    {json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
    text = f'{{\n  "layout": {json.dumps(layout.name)},\n  "points": {{\n{lines}\n  }}\n}}\n'
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _points(data: JsonValue, layout: FeatureLayout, axes: int) -> dict[str, Float[Array, " d"]]:
    data.members(_KEYS)
    name = data["layout"].text()
    if name != layout.name:
        raise data["layout"].error(f"expected {layout.name!r}, found {name[:40]!r}")
    rows = data["points"].members()
    if not rows:
        raise data["points"].error("expected at least one point, found none")
    return {name: _point(name, row, layout, axes) for name, row in rows.items()}


def _point(name: str, row: JsonValue, layout: FeatureLayout, axes: int) -> Float[Array, " d"]:
    if name not in layout.names:
        raise row.error(unknown_name("point", name, layout.names))
    numbers = row.items()
    if len(numbers) != axes:
        expected = "x and y" if axes == 2 else "x, y and z"
        raise row.error(f"expected {expected}, found {len(numbers)} numbers")
    return np.array([JsonValue(number.raw, row.place).number() for number in numbers])
