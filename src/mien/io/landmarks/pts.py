"""Landmark files of iBUG, `.pts`, and which of their 68 points are feature points of zhang134."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import FileFormatError
from mien.io.files.atomic import atomic_file
from mien.limits import MAX_POINTS_BYTES
from mien.reading.files import read_text
from mien.reading.text_numbers import NumberReader

__all__ = ["IBUG_SHARED", "load_pts", "points_from_ibug", "points_to_ibug", "save_pts"]

IBUG_COUNT = 68
_FILE = re.compile(r"\s*version:\s*1(?:\.0*)?\s+n_points:\s*(\d{1,5})\s*\{([^{}]*)\}\s*", re.ASCII)
FIRST_PIXEL_CENTRE = 1.0
"""In iBUG's files, as in Matlab, the first pixel's centre is at (1, 1); here at (0.5, 0.5)."""

IBUG_SHARED = {
    8: "menton",
    **{17 + i: f"right_brow_upper.{4 - i}" for i in range(5)},
    **{22 + i: f"left_brow_upper.{i}" for i in range(5)},
    27: "nose_root",
    30: "nose_tip",
    31: "right_nose_wing.2",
    32: "right_nose_wing.3",
    33: "nose_base",
    34: "left_nose_wing.3",
    35: "left_nose_wing.2",
    36: "right_eye_outer",
    39: "right_eye_inner",
    42: "left_eye_inner",
    45: "left_eye_outer",
    48: "right_mouth_corner",
    50: "right_upper_lip_outer.0",
    51: "upper_lip_outer",
    52: "left_upper_lip_outer.0",
    54: "left_mouth_corner",
    57: "lower_lip_outer",
    60: "right_inner_mouth_corner",
    62: "upper_lip_inner",
    64: "left_inner_mouth_corner",
    66: "lower_lip_inner",
}
"""Names of the points that both have, by iBUG's number, counted from 0."""

# The other points lie on these lines, which both have, evenly between the shared points.
_RIGHT_LINES = {
    (0, 1, 2, 3, 4, 5, 6, 7, 8): "temple jaw.2 jaw.1 jaw.0 =menton",
    (27, 28, 29, 30): "=nose_root =nose_bridge =nose_tip",
    (36, 37, 38, 39): "eye_outer upper_eyelid.3 upper_eyelid.2 upper_eyelid.1 upper_eyelid.0 "
    "eye_inner",
    (36, 41, 40, 39): "eye_outer lower_eyelid.2 lower_eyelid.1 lower_eyelid.0 eye_inner",
    (48, 49, 50): "mouth_corner upper_lip_outer.2 upper_lip_outer.1 upper_lip_outer.0",
    (48, 59, 58, 57): "mouth_corner lower_lip_outer.2 lower_lip_outer.1 lower_lip_outer.0 "
    "=lower_lip_outer",
    (60, 61, 62): "inner_mouth_corner upper_lip_inner.1 upper_lip_inner.0 =upper_lip_inner",
    (60, 67, 66): "inner_mouth_corner lower_lip_inner.1 lower_lip_inner.0 =lower_lip_inner",
}
_MIRRORED = {
    **{i: 16 - i for i in range(17)},
    **dict(zip((27, 28, 29, 30), (27, 28, 29, 30), strict=True)),
    **dict(zip((36, 37, 38, 39, 40, 41), (45, 44, 43, 42, 47, 46), strict=True)),
    **dict(zip((48, 49, 50, 57, 58, 59), (54, 53, 52, 57, 56, 55), strict=True)),
    **dict(zip((60, 61, 62, 66, 67), (64, 63, 62, 66, 65), strict=True)),
}


def load_pts(path: str | Path) -> Float[Array, "n 2"]:
    """The points of a file, (N, 2) px, the first pixel's centre at (0.5, 0.5).

    Raises:
        InputError: the file cannot be read.
        FileFormatError: no such file; says where.
    """
    text = read_text(path, MAX_POINTS_BYTES, "an iBUG .pts file")
    # Comments begin with # or //; their lines stay, so that line numbers in errors are right.
    found = _FILE.fullmatch(re.sub(r"(#|//).*", "", text))
    if found is None:
        expected = "'version: 1', 'n_points: 68' and the points between { and }"
        raise FileFormatError(path, f"expected {expected}")
    # As many blank lines as there were lines before, for the same reason.
    body = "\n" * text[: found.start(2)].count("\n") + found[2]
    numbers = NumberReader(path, "points", body)
    points = []
    while not numbers.at_end:
        points.append((numbers.finite("x"), numbers.finite("y of a point")))
    if len(points) != int(found[1]) or not points:
        problem = f"n_points says {int(found[1])}, found {len(points)} points"
        raise FileFormatError(path, problem)
    return np.array(points) - FIRST_PIXEL_CENTRE + 0.5


def save_pts(path: str | Path, points: Float[Array, "n 2"]) -> None:
    """Write (N, 2) px, the first pixel's centre at (0.5, 0.5), to a thousandth of a pixel.

    Raises:
        InputError: shape, NaN, a place that cannot be written.
    """
    shifted = check_array("points", points, (None, 2)) - 0.5 + FIRST_PIXEL_CENTRE
    rows = [f"{x:.3f} {y:.3f}" for x, y in shifted]
    text = "\n".join(["version: 1", f"n_points: {len(rows)}", "{", *rows, "}"])
    with atomic_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="ascii")


def points_from_ibug(
    points: Float[Array, "68 2"], layout: FeatureLayout
) -> dict[str, Float[Array, " 2"]]:
    """The points of a layout that are among iBUG's, by name. Raises: InputError: shape, NaN."""
    points = check_array("points", points, (IBUG_COUNT, 2))
    return {name: points[i] for i, name in IBUG_SHARED.items() if name in layout.names}


def points_to_ibug(layout: FeatureLayout, points: Float[Array, "n 2"]) -> Float[Array, "68 2"]:
    """The 68 points of iBUG: those shared, and the others evenly along the lines that both have.

    Raises:
        InputError: shape, NaN, a layout without the points that this needs.
    """
    points = check_array("points", points, (len(layout.names), 2))
    ibug = np.empty((IBUG_COUNT, 2))
    for side in ("right", "left"):
        for numbers, names in _RIGHT_LINES.items():
            sided = [n[1:] if n[0] == "=" else f"{side}_{n}" for n in names.split()]
            line = points[[layout.index(name) for name in sided]]
            rows = numbers if side == "right" else [_MIRRORED[number] for number in numbers]
            ibug[list(rows)] = _resampled(line, len(numbers))
    for number, name in IBUG_SHARED.items():
        ibug[number] = points[layout.index(name)]
    return ibug


def _resampled(line: Float[Array, "p 2"], count: int) -> Float[Array, "c 2"]:
    """(C, 2) points at equal distances along a polyline, both ends among them."""
    lengths = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    targets = np.linspace(0, lengths[-1], count)
    return np.column_stack([np.interp(targets, lengths, line[:, axis]) for axis in (0, 1)])
