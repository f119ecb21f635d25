"""JSON files of what is drawn on a face: every complaint names the file and the place in it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from mien.errors import Broken, FileFormatError, InputError

VERSION = 1
_LARGEST_SHARE = 1e6

_KINDS: dict[type, str] = {str: "text", int: "a whole number", list: "a list", dict: "an object"}
_Kind = TypeVar("_Kind")


def read_data(path: Path, format_name: str, build: Callable[[dict[str, Any]], _Kind]) -> _Kind:
    """What `build` makes of the document in a file of this format.

    Raises: InputError: the file cannot be read. FileFormatError: not such a file; says where.
    """
    try:
        document = json.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except (ValueError, RecursionError):
        raise FileFormatError(path, "expected JSON in UTF-8") from None
    try:
        found = need(document, "format", str)
        if found != format_name:
            raise Broken("format", f"expected {format_name!r}, found {found[:40]!r}")
        if need(document, "version", int) != VERSION:
            problem = f"expected {VERSION}, found {document['version']}: written by a newer mien"
            raise Broken("version", problem)
        return build(document)
    except Broken as broken:
        raise FileFormatError(path, broken.problem, broken.place) from None


def need(data: Any, key: str, kind: type[_Kind], place: str = "") -> _Kind:
    """data[key], of this kind. Raises: Broken."""
    where = f"{place}.{key}" if place else key
    if not isinstance(data, dict):
        raise Broken(place, f"expected an object with {key!r}, found {str(data)[:40]!r}")
    if not isinstance(data.get(key), kind):
        found = repr(data[key])[:40] if key in data else "nothing"
        raise Broken(where, f"expected {_KINDS[kind]}, found {found}")
    value: _Kind = data[key]
    return value


def shares(
    data: dict[str, Any], index: Callable[[str], int | None], place: str
) -> dict[int, float]:
    """Shares that sum to 1, by the index that each name stands for. Raises: Broken."""
    found: dict[int, float] = {}
    for name, share in data.items():
        number = index(name)
        if number is None:
            raise Broken(place, f"unknown point {name[:40]!r}")
        # A share may lie outside of the hull, but whole numbers may have any number of digits.
        number_like = isinstance(share, int | float) and not isinstance(share, bool)
        if not number_like or abs(share) > _LARGEST_SHARE:
            raise Broken(place, f"expected a number, found {str(share)[:40]!r}")
        found[number] = float(share)
    if not abs(sum(found.values()) - 1) < 1e-6:
        raise Broken(place, f"expected shares that sum to 1, found {sum(found.values()):g}")
    return found
