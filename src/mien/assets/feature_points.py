"""The feature points of expression synthesis: names, sets, triangles."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.assets.data_file import affine_weights, read_data
from mien.assets.landmark_sets import LANDMARK_COUNT
from mien.errors import DocumentError, InputError
from mien.numeric.planar_similarity import estimate_planar_similarity
from mien.reading.strict_json import JsonValue

__all__ = ["FeatureLayout", "load_feature_layout"]

_FORMAT = "mien feature points"


@dataclass(frozen=True)
class FeatureLayout:
    """The feature points of a face, with their sets and the triangles over them.

    Attributes:
        name: "zhang134".
        names: of the points; right and left are the subject's.
        sets: of each level, the indices of each set's points ([Zhang 2006] section 10, Fig. 4).
        set_names: likewise.
        mirror: (n,) each point's counterpart on the other side, its own on the midline.
        template: (n, 2) on a mean face from the front, mouth open; its width is 1, y down, x to the
            subject's left.
        triangles: (T, 3) over the points and, after them, those of `frame`; none is folded over on
            the template.
        landmark_weights: (n, 478) each point as an affine combination of the detector's landmarks;
            rows sum to 1.
        rigid: points that move with the head alone ([Zhang 2006] section 12.1).
        template_frame: (k, 2) the points of `frame` on the template.

    Source:
        [Zhang 2006] section 5.1, Fig. 2a.
    """

    name: str
    names: tuple[str, ...]
    sets: tuple[tuple[Int[Array, " s"], ...], ...]
    set_names: tuple[tuple[str, ...], ...]
    mirror: Int[Array, " n"]
    template: Float[Array, "n 2"]
    triangles: Int[Array, "t 3"]
    landmark_weights: Float[Array, "n 478"]
    rigid: Int[Array, " r"]
    template_frame: Float[Array, "k 2"]

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.names)}

    @cached_property
    def face_triangles(self) -> Int[Array, "t 3"]:
        """(T, 3) those of the triangles that need no point of `frame`."""
        return frozen(self.triangles[(self.triangles < len(self.names)).all(axis=1)])

    def index(self, name: str) -> int:
        """The index of a point.

        Raises:
            InputError: no point has this name; lists those that are close.
        """
        if name not in self._indices:
            close = difflib.get_close_matches(name, self.names, n=3)
            expected = f"a point of {self.name}"
            raise InputError(
                "feature point", expected + (f" such as {', '.join(close)}" if close else ""), name
            )
        return self._indices[name]

    def from_landmarks(self, landmarks: Float[Array, "478 2"]) -> Float[Array, "n 2"]:
        """The points on a face whose landmarks the detector found, in the same pixels.

        Raises:
            InputError: shape, NaN.
        """
        return self.landmark_weights @ check_array("landmarks", landmarks, (LANDMARK_COUNT, 2))

    def frame(self, points: Float[Array, "n 2"]) -> Float[Array, "k 2"]:
        """Points around the face that follow the head and no expression, in the same pixels.

        Raises:
            InputError: shape, NaN.
            EstimationError: rigid points in one place.

        Source:
            [Zhang 2006] section 12, eq. (8) and (9), over the rigid points.
        """
        points = check_array("points", points, (len(self.names), 2))
        motion = estimate_planar_similarity(self.template[self.rigid], points[self.rigid])
        return motion(self.template_frame)


def load_feature_layout(path: str | Path | None = None) -> FeatureLayout:
    """The 134 points that ship with mien, or those of a file of the same kind.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: it holds no layout; names the place.
    """
    shipped = str(files("mien.assets") / "data" / "zhang134.json")
    return read_data(Path(path or shipped), _FORMAT, _layout)


def _layout(document: JsonValue) -> FeatureLayout:
    points = document["points"].items()
    names = tuple(point["name"].text() for point in points)
    for name in names:
        if names.count(name) > 1:
            raise DocumentError("points", f"{name!r} appears twice")
    points = [JsonValue(point.raw, name) for point, name in zip(points, names, strict=True)]
    frame = _points_2d(document["frame"].items(), "frame")
    sets = _sets(document["sets"].items(), names)
    return FeatureLayout(
        name=document["name"].text(),
        names=names,
        sets=tuple(tuple(level.values()) for level in sets),
        set_names=tuple(tuple(level) for level in sets),
        mirror=_mirror(points, names),
        template=_points_2d([point["template"] for point in points], "template"),
        triangles=_triangles(document["triangles"], len(names) + len(frame)),
        landmark_weights=_landmark_weights(points),
        rigid=_rigid(document["rigid"], names),
        template_frame=frame,
    )


def _indices(members: JsonValue, names: tuple[str, ...]) -> Int[Array, " s"]:
    """The points of these names."""
    if not isinstance(members.raw, list) or not members.raw:
        raise members.error("expected a list of points")
    for member in members.raw:
        if member not in names:
            raise members.error(f"unknown point {str(member)[:40]!r}")
    return frozen(np.array([names.index(member) for member in members.raw]))


def _sets(levels: list[JsonValue], names: tuple[str, ...]) -> list[dict[str, Int[Array, " s"]]]:
    """Levels of sets that hold every point; each set shares a point with the level above."""
    found = []
    for document in levels:
        if not isinstance(document.raw, dict):
            raise document.error("expected an object of lists of points")
        found.append({name: _indices(named, names) for name, named in document.members().items()})
    for number, level in enumerate(found):
        for name, members in level.items():
            near = [s for other in found[max(number - 1, 0) : number] for s in other.values()]
            if number and not any(np.isin(members, other).any() for other in near):
                raise DocumentError(
                    f"sets[{number}].{name}", "shares no point with the level above"
                )
    held = {int(i) for level in found for members in level.values() for i in members}
    if missing := [name for i, name in enumerate(names) if i not in held]:
        raise DocumentError("sets", f"{missing[0]!r} belongs to none")
    return found


def _rigid(members: JsonValue, names: tuple[str, ...]) -> Int[Array, " r"]:
    indices = _indices(members, names)
    if len(indices) < 2:
        raise DocumentError("rigid", "expected at least 2 points")
    return indices


def _points_2d(rows: list[JsonValue], place: str) -> Float[Array, "n 2"]:
    try:
        return frozen(check_array(place, [row.raw for row in rows], (None, 2)))
    except InputError as error:
        raise DocumentError(place, f"expected {error.expected}, found {error.got}") from None


def _mirror(points: list[JsonValue], names: tuple[str, ...]) -> Int[Array, " n"]:
    partners = [point["mirror"].text() for point in points]
    mirror = _indices(JsonValue(partners, "mirror"), names)
    for index, name in enumerate(names):
        if mirror[mirror[index]] != index:
            problem = f"its counterpart {partners[index]!r} has another one"
            raise DocumentError(f"{name}.mirror", problem)
    return mirror


def _triangles(value: JsonValue, count: int) -> Int[Array, "t 3"]:
    rows = [item.raw for item in value.items()]
    triangles = np.array(rows) if all(_is_triple(row) for row in rows) else None
    if triangles is None or not len(rows) or triangles.min() < 0 or triangles.max() >= count:
        raise value.error(f"expected triples of whole numbers from 0 to {count - 1}")
    return frozen(triangles)


def _is_triple(row: Any) -> bool:
    return isinstance(row, list) and len(row) == 3 and all(type(entry) is int for entry in row)


def _landmark_weights(points: list[JsonValue]) -> Float[Array, "n 478"]:
    weights = np.zeros((len(points), LANDMARK_COUNT))
    for row, point in zip(weights, points, strict=True):
        found = affine_weights(point["landmarks"], _landmark)
        row[list(found)] = list(found.values())
    return frozen(weights)


def _landmark(number: str) -> int | None:
    whole = number.isascii() and number.isdecimal() and len(number) <= len(str(LANDMARK_COUNT))
    return int(number) if whole and int(number) < LANDMARK_COUNT else None
