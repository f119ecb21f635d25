"""JSON that is read with care: every complaint names its place."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from mien.errors import Broken, FileFormatError, InputError

LARGEST = 1e9
"""No document means larger numbers, and sums and products of these stay exact enough."""


def read_json(path: str | Path) -> dict[str, Any]:
    """The object in a JSON file.

    Raises: InputError: the file cannot be read. FileFormatError: not JSON in UTF-8, another thing
        than an object, a name that appears twice in one object.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_bytes().decode("utf-8-sig"), object_pairs_hook=_without_repeats)
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except UnicodeDecodeError:
        raise FileFormatError(path, "expected JSON in UTF-8, found other bytes") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise FileFormatError(path, f"expected JSON: {error.msg}", place) from None
    except _RepeatedName as repeated:
        raise FileFormatError(path, "the name appears twice", repeated.args[0]) from None
    except (RecursionError, ValueError) as error:
        problem = f"expected JSON, found {str(error)[:60]}"
        raise FileFormatError(path, problem) from None
    if not isinstance(data, dict):
        raise FileFormatError(path, f"expected an object, found {kind_of(data)}")
    return data


def check_format(data: Mapping[str, Any], name: str, version: int) -> None:
    """Raises: Broken: another format than this one, or a version of it newer than this."""
    if data.get("format") != name:
        raise Broken("format", f"expected {name!r}, found {str(data.get('format'))[:40]!r}")
    found = as_whole(data.get("version"), "version", above=0)
    if found > version:
        problem = f"{found} was written by a newer mien; this one reads up to {version}"
        raise Broken("version", problem)


def as_object(value: object, place: str, keys: Iterable[str] | None = None) -> dict[str, Any]:
    """An object with none but these keys. Raises: Broken: suggests the nearest keys."""
    if not isinstance(value, dict):
        complain(place, "an object", value)
    if keys is not None:
        known = tuple(keys)
        for key in value:
            if key not in known:
                raise Broken(join(place, key), unknown("key", key, known))
    return value


def as_list(value: object, place: str) -> list[Any]:
    """A list. Raises: Broken."""
    if not isinstance(value, list):
        complain(place, "a list", value)
    return value


def as_text(value: object, place: str) -> str:
    """Text. Raises: Broken."""
    if not isinstance(value, str):
        complain(place, "text", value)
    return value


def as_choice(value: object, place: str, kind: str, names: Collection[str]) -> str:
    """One of these names. Raises: Broken: suggests the nearest ones."""
    name = as_text(value, place)
    if name not in names:
        raise Broken(place, unknown(kind, name, names))
    return name


def as_number(
    value: object, place: str, *, above: float = -LARGEST, most: float = LARGEST
) -> float:
    """A finite number, above and at most these limits. Raises: Broken."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        complain(place, "a number", value)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise Broken(place, f"expected a finite number, found {number}")
    if not above < number <= most:
        limits = f"above {above:g} and at most {most:g}"
        raise Broken(place, f"expected a number {limits}, found {number:g}")
    return number


def as_whole(value: object, place: str, *, above: float = -LARGEST, most: float = LARGEST) -> int:
    """A whole number. Raises: Broken."""
    if isinstance(value, bool) or not isinstance(value, int):
        complain(place, "a whole number", value)
    as_number(value, place, above=above, most=most)
    return value


def need(data: Mapping[str, Any], key: str, place: str) -> Any:
    """data[key]. Raises: Broken: there is none."""
    if key not in data:
        raise Broken(join(place, key), "missing")
    return data[key]


def join(place: str, key: str) -> str:
    """The place of a key in the object at a place."""
    return f"{place}.{key}" if place else key


def unknown(kind: str, name: str, known: Collection[str]) -> str:
    """What to say of a name that is none of the known ones."""
    close = difflib.get_close_matches(name, sorted(known), n=3)
    if close:
        return f"unknown {kind} {name!r}; did you mean {' or '.join(close)}?"
    few = ", ".join(sorted(known)[:8]) + (", ..." if len(known) > 8 else "")
    return f"unknown {kind} {name!r}; expected one of {few}" if few else f"unknown {kind} {name!r}"


def kind_of(value: object) -> str:
    """What JSON calls a value like this one."""
    if value is None:
        return "null"
    names = {bool: "true or false", dict: "an object", list: "a list", str: "text"}
    return names.get(type(value), "a number")


def complain(place: str, expected: str, value: object) -> NoReturn:
    """Raises: Broken: says what kind of value is there instead."""
    shown = f" {str(value)[:40]!r}" if isinstance(value, str) else ""
    raise Broken(place, f"expected {expected}, found {kind_of(value)}{shown}")


class _RepeatedName(Exception):
    pass


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        names = [name for name, _ in pairs]
        raise _RepeatedName(next(name for name in names if names.count(name) > 1))
    return data
