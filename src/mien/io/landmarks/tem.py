"""Delineations of Psychomorph and WebMorph, `.tem`: points, and lines drawn through them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError, OtherPointsError
from mien.io.files.atomic import atomic_file
from mien.io.landmarks.tem_templates import TEMPLATES
from mien.reading.text_numbers import NumberReader

__all__ = ["Delineation", "TemLine", "load_tem", "points_from_tem", "points_to_tem", "save_tem"]


@dataclass(frozen=True)
class TemLine:
    """A line through points of a delineation; a closed one names its first point again."""

    closed: bool
    points: Int[Array, " p"]


@dataclass(frozen=True)
class Delineation:
    """What a `.tem` file holds.

    Attributes:
        points: (N, 2) px, origin at the picture's top-left corner, y down.
        lines: drawn through them.
    """

    points: Float[Array, "n 2"]
    lines: tuple[TemLine, ...]


def load_tem(path: str | Path) -> Delineation:
    """The delineation in a file.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: no delineation; says where.
    """
    numbers = NumberReader(path, "a .tem delineation")
    count = numbers.count("number of points")
    points = [(numbers.finite("a point"), numbers.finite("a point")) for _ in range(count)]
    lines = [_line(numbers, count) for _ in range(0 if numbers.at_end else numbers.whole("lines"))]
    numbers.expect_end()
    return Delineation(np.array(points), tuple(lines))


def _line(numbers: NumberReader, count: int) -> TemLine:
    closed = numbers.whole("a line: 0 for open or 1 for closed", below=2) == 1
    length = numbers.count("number of a line's points")
    points = [numbers.whole("a line's point", below=count) for _ in range(length)]
    return TemLine(closed, np.array(points))


def save_tem(path: str | Path, delineation: Delineation) -> None:
    """Write a delineation, to a thousandth of a pixel.

    Raises:
        InputError: shapes, NaN, a line through a point that is not there, a place that cannot be
            written.
    """
    points = check_array("points", delineation.points, (None, 2))
    rows = [str(len(points)), *(f"{x:.3f}\t{y:.3f}" for x, y in points)]
    rows.append(str(len(delineation.lines)))
    for line in delineation.lines:
        indices = np.asarray(line.points)
        if not len(indices) or indices.min() < 0 or indices.max() >= len(points):
            raise InputError("lines", f"points from 0 to {len(points) - 1}", indices.tolist())
        rows += [str(int(line.closed)), str(len(indices)), " ".join(map(str, indices))]
    with atomic_file(path) as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="ascii")


def points_to_tem(layout: FeatureLayout, points: Float[Array, "n 2"]) -> Delineation:
    """All points of a layout in their order, with a line through each row of them.

    Raises:
        InputError: shape, NaN.
    """
    points = check_array("points", points, (len(layout.names), 2))
    rows: dict[str, list[int]] = {}
    for index, name in enumerate(layout.names):
        if found := re.fullmatch(r"(.+)\.\d+", name):
            rows.setdefault(found[1], []).append(index)
    return Delineation(points, tuple(TemLine(False, np.array(row)) for row in rows.values()))


def points_from_tem(
    delineation: Delineation, layout: FeatureLayout, name: str | Path = "delineation"
) -> dict[str, Float[Array, " 2"]]:
    """The points of a layout in a delineation: all, or those shared with another template.

    Args:
        delineation: as load_tem returns it.
        layout: of the points wanted.
        name: of the file, for messages.

    Raises:
        OtherPointsError: a template that is not in `TEMPLATES`.
    """
    count = len(delineation.points)
    if count == len(layout.names):
        return dict(zip(layout.names, delineation.points, strict=True))
    if count in TEMPLATES:
        shared = {n: i for n, i in TEMPLATES[count].shared.items() if n in layout.names}
        return {name: delineation.points[index] for name, index in shared.items()}
    known = [f"{known} ({template.origin})" for known, template in TEMPLATES.items()]
    expected = f"{len(layout.names)} points ({layout.name}), {', '.join(known)}"
    raise OtherPointsError(name, f"expected {expected}, found {count}")
