"""JSON files of what is drawn on a face: every complaint names the file and the place in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from mien.errors import DocumentError, FileFormatError
from mien.reading import strict_json
from mien.reading.strict_json import (
    DocumentFormat,
    as_list,
    as_number,
    as_object,
    as_text,
    join,
    read_json,
)

VERSION = 1
_LARGEST_SHARE = 1e6

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
        FileFormatError: not such a file; says where.
    """
    document = read_json(path)
    try:
        DocumentFormat(format_name, VERSION).check(document)
        return build(document)
    except DocumentError as broken:
        raise FileFormatError(path, broken.problem, broken.place) from None


def need(data: Any, key: str, kind: type[_Kind], place: str = "") -> _Kind:
    """data[key], of this kind. Raises: DocumentError."""
    entry = strict_json.need(as_object(data, place), key, place)
    return _READERS[kind](entry, join(place, key))


def shares(
    data: dict[str, Any], index: Callable[[str], int | None], place: str
) -> dict[int, float]:
    """Shares that sum to 1, by the index that each name stands for. Raises: DocumentError."""
    found: dict[int, float] = {}
    for name, share in data.items():
        number = index(name)
        if number is None:
            raise DocumentError(place, f"unknown point {name[:40]!r}")
        # A share may lie outside of the hull.
        found[number] = as_number(share, place, least=-_LARGEST_SHARE, most=_LARGEST_SHARE)
    if not abs(sum(found.values()) - 1) < 1e-6:
        raise DocumentError(place, f"expected shares that sum to 1, found {sum(found.values()):g}")
    return found
