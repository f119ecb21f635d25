"""P.json: where some or all feature points of a layout are in a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import DocumentError, InputError
from mien.io.files.atomic import atomic_file
from mien.reading.strict_json import (
    as_list,
    as_number,
    as_object,
    as_text,
    errors_name_file,
    join,
    need,
    read_json,
    unknown_name,
)

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
    data = read_json(path)
    with errors_name_file(path):
        return _points(as_object(data, "", _KEYS), layout, axes)


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


def _points(
    data: Mapping[str, object], layout: FeatureLayout, axes: int
) -> dict[str, Float[Array, " d"]]:
    name = as_text(need(data, "layout", ""), "layout")
    if name != layout.name:
        raise DocumentError("layout", f"expected {layout.name!r}, found {name[:40]!r}")
    rows = as_object(need(data, "points", ""), "points")
    if not rows:
        raise DocumentError("points", "expected at least one point, found none")
    return {name: _point(name, row, layout, axes) for name, row in rows.items()}


def _point(name: str, row: object, layout: FeatureLayout, axes: int) -> Float[Array, " d"]:
    place = join("points", name)
    if name not in layout.names:
        raise DocumentError(place, unknown_name("point", name, layout.names))
    numbers = as_list(row, place)
    if len(numbers) != axes:
        expected = "x and y" if axes == 2 else "x, y and z"
        raise DocumentError(place, f"expected {expected}, found {len(numbers)} numbers")
    return np.array([as_number(number, place) for number in numbers])
