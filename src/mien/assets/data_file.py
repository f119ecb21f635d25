"""JSON files of what is drawn on a face; every error names the file and the place in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from mien.errors import DocumentError
from mien.reading.strict_json import (
    DocumentFormat,
    as_list,
    as_number,
    as_object,
    as_text,
    errors_name_file,
    join,
    need,
    read_json,
)

_VERSION = 1
_MAX_WEIGHT = 1e6

_Kind = TypeVar("_Kind")
_READERS: dict[type, Callable[[object, str], Any]] = {
    str: as_text,
    list: as_list,
    dict: as_object,
}


def read_data(path: Path, format_name: str, build: Callable[[dict[str, Any]], _Kind]) -> _Kind:
    """What `build` makes of the document in a file of this format.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: not such a file; names the place.
    """
    document = read_json(path)
    with errors_name_file(path):
        DocumentFormat(format_name, _VERSION).check(document)
        return build(document)


def typed_entry(data: Any, key: str, kind: type[_Kind], place: str = "") -> _Kind:
    """data[key], of this type. Raises: DocumentError."""
    entry = need(as_object(data, place), key, place)
    return _READERS[kind](entry, join(place, key))


def affine_weights(
    data: dict[str, Any], index: Callable[[str], int | None], place: str
) -> dict[int, float]:
    """Weights that sum to 1, by the index of the point that each name stands for.

    Raises:
        DocumentError: an unknown name, no numbers, another sum.
    """
    weights: dict[int, float] = {}
    for name, weight in data.items():
        number = index(name)
        if number is None:
            raise DocumentError(place, f"unknown point {name[:40]!r}")
        # A weight may lie outside of [0, 1].
        weights[number] = as_number(weight, place, least=-_MAX_WEIGHT, most=_MAX_WEIGHT)
    if not abs(sum(weights.values()) - 1) < 1e-6:
        total = sum(weights.values())
        raise DocumentError(place, f"expected shares that sum to 1, found {total:g}")
    return weights
