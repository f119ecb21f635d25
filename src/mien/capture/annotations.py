"""Points and curves that a person drew on a photo."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.assets.generic import GenericHead
from mien.capture.images.photos import Photo
from mien.errors import FileFormatError, InputError
from mien.limits import LARGEST
from mien.reading.strict_json import join, json_type, read_json

_KEYS = ("photo", "size", "points", "curves")
_ASPECT_TOLERANCE = 0.005


@dataclass(frozen=True)
class AnnotationNames:
    """The names that annotations may use.

    Attributes:
        points: names of single points: [Pighin 2002]'s 13, and every vertex of a polyline
            (`left_jaw.3`).
        curves: names of polylines.
    """

    points: frozenset[str]
    curves: frozenset[str]

    @classmethod
    def of(cls, head: GenericHead) -> Self:
        """The names of the generic head's points and polylines."""
        vertices = (
            f"{name}.{index}"
            for name, polyline in head.polylines.items()
            for index in range(len(polyline))
        )
        return cls(frozenset((*head.points, *vertices)), frozenset(head.polylines))


@dataclass(frozen=True)
class Annotations:
    """Hand-made marks, in px of the photo as loaded.

    Attributes:
        points: (2,) by name.
        curves: (M, 2), M >= 2, by polyline name, drawn in the polyline's direction.
        notes: what was adapted while reading.
    """

    points: dict[str, Float[Array, " 2"]] = field(default_factory=dict)
    curves: dict[str, Float[Array, "m 2"]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.points or self.curves)


def load_annotations(path: str | Path, photo: Photo, *, names: AnnotationNames) -> Annotations:
    """The marks in an annotation file, in px of the photo as loaded.

    The file's pixels are those of the photo after EXIF orientation at the size that it states (by
    default the photo's own); a photo that was reduced while loading has its marks reduced alike.

    Args:
        path: the annotation file.
        photo: the photo that it belongs to.
        names: that it may use.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: not JSON; an unknown or repeated name (the nearest one is suggested); a
            coordinate that is no finite number or lies outside of the photo; a curve with fewer
            than two points; a size of another shape than the photo's.
    """
    path = Path(path)
    data = _read(path)
    size, notes = _stated_size(path, data, photo)
    factor = np.array(photo.size) / size
    points = {
        name: frozen(_points(path, f"points.{name}", [place], size)[0] * factor)
        for name, place in _section(path, data, "points", names.points).items()
    }
    curves = {
        name: frozen(_curve(path, f"curves.{name}", places, size) * factor)
        for name, places in _section(path, data, "curves", names.curves).items()
    }
    return Annotations(points, curves, notes)


def save_annotations(path: str | Path, photo: Photo, annotations: Annotations) -> None:
    """Write the marks in px of the photo as loaded; an old file stays until the new one is whole.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    data = {
        "photo": photo.name,
        "size": list(photo.size),
        "points": {name: _rounded(place) for name, place in annotations.points.items()},
        "curves": {name: _rounded(places) for name, places in annotations.curves.items()},
    }
    unfinished = path.with_name(path.name + ".tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
        os.replace(unfinished, path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise InputError(path, "a place to write to", error.strerror or error) from None


def _rounded(places: Array) -> Any:
    """To thousandths of a pixel, finer than any hand."""
    return np.round(places, 3).tolist()


def _read(path: Path) -> dict[str, Any]:
    data = read_json(path)
    for key in data:
        if key not in _KEYS:
            raise FileFormatError(path, f"unknown key{_nearest(key, _KEYS)}", key[:60])
    return data


def _stated_size(
    path: Path, data: Mapping[str, Any], photo: Photo
) -> tuple[Float[Array, " 2"], tuple[str, ...]]:
    """(width, height) in which the marks are given."""
    assert photo.original_size is not None
    original = np.array(photo.original_size, dtype=np.float64)
    if "size" not in data:
        return original, ()
    size = _numbers(data["size"])
    if size is None or size.shape != (2,) or not ((size > 0) & (size <= LARGEST)).all():
        raise FileFormatError(path, "expected [width, height] in px", "size")
    if (size == original).all() or (size == photo.size).all():
        return size, ()
    stated, actual = (f"{pair[0]:g}x{pair[1]:g}" for pair in (size, original))
    stretch = np.log(size / original)
    if abs(stretch[0] - stretch[1]) > _ASPECT_TOLERANCE:
        problem = f"expected {actual}, the size of {photo.name}, or a multiple; found {stated}"
        raise FileFormatError(path, problem, "size")
    return size, (f"marks made at {stated} are scaled to {actual}",)


def _section(
    path: Path, data: Mapping[str, Any], key: str, known: frozenset[str]
) -> dict[str, Any]:
    section = data.get(key, {})
    if not isinstance(section, dict):
        raise FileFormatError(path, f"expected an object, found {json_type(section)}", key)
    for name in section:
        if name not in known:
            raise FileFormatError(path, f"unknown name{_nearest(name, known)}", join(key, name))
    return section


def _curve(path: Path, place: str, value: Any, size: Array) -> Float[Array, "m 2"]:
    if not isinstance(value, list) or len(value) < 2:
        found = len(value) if isinstance(value, list) else json_type(value)
        raise FileFormatError(path, f"expected two points or more, found {found}", place)
    points = _points(path, place, value, size)
    if (points == points[0]).all():
        raise FileFormatError(path, "expected a curve, found one place repeated", place)
    return points


def _points(path: Path, place: str, value: list[Any], size: Array) -> Float[Array, "m 2"]:
    for item in value:
        point = _numbers(item)
        if point is None or point.shape != (2,):
            raise FileFormatError(path, f"expected [x, y] in px, found {_brief(item)}", place)
        if not np.isfinite(point).all():
            raise FileFormatError(path, f"expected finite numbers, found {_brief(item)}", place)
        if (point < 0).any() or (point > size).any():
            inside = f"a place within the photo's {size[0]:g}x{size[1]:g} px"
            raise FileFormatError(path, f"expected {inside}, found {_brief(item)}", place)
    return np.array(value, dtype=np.float64)


def _numbers(value: Any) -> Array | None:
    """A flat list of numbers as an array, or None; true and "1" are no numbers."""
    if not isinstance(value, list):
        return None
    if not all(isinstance(item, int | float) and not isinstance(item, bool) for item in value):
        return None
    try:
        return np.array(value, dtype=np.float64)
    except OverflowError:
        return np.full(len(value), np.inf)


def _nearest(name: str, known: frozenset[str] | tuple[str, ...]) -> str:
    match = difflib.get_close_matches(name[:60], sorted(known), n=1, cutoff=0.5)
    return f"; did you mean {match[0]}?" if match else f"; known are {', '.join(sorted(known)[:5])}"


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
