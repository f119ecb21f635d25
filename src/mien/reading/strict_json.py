"""JSON, read strictly: every error names its place in the document."""

from __future__ import annotations

import difflib
import json
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from mien.arrays import Array
from mien.errors import DocumentError, FileFormatError, InputError
from mien.limits import LARGEST, MAX_CONTAINERS, MAX_DEPTH, MAX_DIGITS, MAX_JSON_BYTES
from mien.reading.files import read_text


def read_json(path: str | Path) -> dict[str, Any]:
    """The object in a JSON file.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: as parse_json; a file that is too large, other bytes than UTF-8, another
            thing than an object.
    """
    data = parse_json(path, read_text(path, MAX_JSON_BYTES, "JSON in UTF-8"))
    if not isinstance(data, dict):
        raise FileFormatError(path, f"expected an object, found {json_type(data)}")
    return data


def parse_json(path: str | Path, text: str, *, line: int | None = None) -> Any:
    """The value of a JSON text. NaN and infinity pass here; as_number refuses them.

    Args:
        path: the file, for messages.
        text: all of the file, or one line of it.
        line: its number, if it is one line.

    Raises:
        FileFormatError: not JSON; a name that appears twice in one object; too many lists and
            objects, too many within each other; a number of too many digits.
    """
    place = "" if line is None else f"line {line}"
    if text.count("[") + text.count("{") > MAX_CONTAINERS:
        problem = f"expected at most {MAX_CONTAINERS} lists and objects, found more"
        raise FileFormatError(path, problem, place)
    try:
        data = json.loads(text, object_pairs_hook=_without_repeats, parse_int=_whole)
        _check_depth(data)
    except json.JSONDecodeError as error:
        where = f"line {line or error.lineno}, column {error.colno}"
        raise FileFormatError(path, f"expected JSON: {error.msg}", where) from None
    except _RepeatedName as repeated:
        where = f"{place}, {repeated.name}" if place else repeated.name
        raise FileFormatError(path, "the name appears twice", where) from None
    except _LongNumber as long:
        where = place or f"line {text.count(chr(10), 0, text.find(long.digits)) + 1}"
        problem = f"expected numbers of at most {MAX_DIGITS} digits, found {len(long.digits)}"
        raise FileFormatError(path, problem, where) from None
    except RecursionError:
        problem = f"expected lists and objects at most {MAX_DEPTH} deep, found deeper ones"
        raise FileFormatError(path, problem, place) from None
    return data


@dataclass(frozen=True)
class DocumentFormat:
    """The format that a document of mien states.

    Attributes:
        name: the document's `format`.
        version: its `version` when written, and the newest that can be read.
    """

    name: str
    version: int

    @property
    def header(self) -> dict[str, Any]:
        """The first entries of a document of this format."""
        return {"format": self.name, "version": self.version}

    def check(self, data: Mapping[str, Any]) -> None:
        """Raises: DocumentError: another format than this one, or a newer version of it."""
        if data.get("format") != self.name:
            found = str(data.get("format"))[:40]
            raise DocumentError("format", f"expected {self.name!r}, found {found!r}")
        version = as_whole(data.get("version"), "version", above=0)
        if version > self.version:
            by = f" ({str(data['generator'])[:40]})" if "generator" in data else ""
            limit = f"this one reads up to {self.version}"
            raise DocumentError("version", f"{version} was written by a newer mien{by}; {limit}")

    def is_in(self, path: str | Path) -> bool:
        """Whether a file holds a document of this format, of whatever version."""
        try:
            return bool(read_json(path).get("format") == self.name)
        except (FileFormatError, InputError):
            return False


@contextmanager
def errors_name_file(path: str | Path, line: int | None = None) -> Iterator[None]:
    """Turn errors in a document into errors that name its file.

    Args:
        path: the file.
        line: its line that holds the document, if it is one line.

    Raises:
        FileFormatError: for a DocumentError or an InputError in the block.
    """
    within = "" if line is None else f"line {line}, "
    try:
        yield
    except DocumentError as error:
        raise FileFormatError(path, error.problem, f"{within}{error.place}") from None
    except InputError as error:
        problem = f"expected {error.expected}, found {error.got}"
        raise FileFormatError(path, problem, f"{within}{error.name}") from None


def as_object(value: object, place: str, keys: Iterable[str] | None = None) -> dict[str, Any]:
    """An object with none but these keys. Raises: DocumentError: suggests the nearest keys."""
    if not isinstance(value, dict):
        raise_unexpected(place, "an object", value)
    if keys is not None:
        known = tuple(keys)
        for key in value:
            if key not in known:
                raise DocumentError(join(place, key), unknown_name("key", key, known))
    return value


def as_list(value: object, place: str) -> list[Any]:
    """A list. Raises: DocumentError."""
    if not isinstance(value, list):
        raise_unexpected(place, "a list", value)
    return value


def as_text(value: object, place: str) -> str:
    """Text. Raises: DocumentError."""
    if not isinstance(value, str):
        raise_unexpected(place, "text", value)
    return value


def as_choice(value: object, place: str, kind: str, names: Collection[str]) -> str:
    """One of these names. Raises: DocumentError: suggests the nearest ones."""
    name = as_text(value, place)
    if name not in names:
        raise DocumentError(place, unknown_name(kind, name, names))
    return name


def as_number(
    value: object,
    place: str,
    *,
    above: float | None = None,
    least: float = -LARGEST,
    most: float = LARGEST,
) -> float:
    """A finite number above one limit or from the other on. Raises: DocumentError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise_unexpected(place, "a number", value)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DocumentError(place, f"expected a finite number, found {number}")
    if above is not None and not above < number <= most:
        limits = f"above {above:g} and at most {most:g}"
        raise DocumentError(place, f"expected a number {limits}, found {number:g}")
    if not least <= number <= most:
        raise DocumentError(
            place, f"expected a number from {least:g} to {most:g}, found {number:g}"
        )
    return number


def as_whole(
    value: object,
    place: str,
    *,
    above: float | None = None,
    least: float = -LARGEST,
    most: float = LARGEST,
) -> int:
    """A whole number within these limits. Raises: DocumentError."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise_unexpected(place, "a whole number", value)
    as_number(value, place, above=above, least=least, most=most)
    return value


def as_array(value: object, place: str, shape: tuple[int, ...]) -> Array:
    """Nested lists of finite numbers as an array of this shape. Raises: DocumentError."""
    if not shape:
        return np.array(as_number(value, place))
    items = as_list(value, place)
    if len(items) != shape[0]:
        what = "numbers" if len(shape) == 1 else "lists"
        raise DocumentError(place, f"expected {shape[0]} {what}, found {len(items)}")
    rows = [as_array(item, f"{place}[{i}]", shape[1:]) for i, item in enumerate(items)]
    return np.array(rows, dtype=np.float64).reshape(shape)


def as_names(value: object, place: str) -> tuple[str, ...]:
    """A list of texts, each once. Raises: DocumentError."""
    names = tuple(as_text(name, f"{place}[{i}]") for i, name in enumerate(as_list(value, place)))
    for name, count in Counter(names).items():
        if count > 1:
            raise DocumentError(place, f"{name[:60]!r} appears twice")
    return names


def need(data: Mapping[str, Any], key: str, place: str) -> Any:
    """data[key]. Raises: DocumentError: there is none."""
    if key not in data:
        raise DocumentError(join(place, key), "missing")
    return data[key]


def join(place: str, key: str) -> str:
    """The place of a key in the object at a place."""
    key = key if len(key) <= 60 else f"{key[:57]}..."
    return f"{place}.{key}" if place else key


def unknown_name(kind: str, name: str, known: Collection[str]) -> str:
    """The problem of a name that is none of the known ones, for a message."""
    name = name if len(name) <= 60 else f"{name[:57]}..."
    close = difflib.get_close_matches(name, sorted(known), n=3)
    if close:
        return f"unknown {kind} {name!r}; did you mean {' or '.join(close)}?"
    few = ", ".join(sorted(known)[:8]) + (", ..." if len(known) > 8 else "")
    return f"unknown {kind} {name!r}; expected one of {few}" if few else f"unknown {kind} {name!r}"


def json_type(value: object) -> str:
    """The JSON type of a value, for messages."""
    if value is None:
        return "null"
    names = {bool: "true or false", dict: "an object", list: "a list", str: "text"}
    return names.get(type(value), "a number")


def raise_unexpected(place: str, expected: str, value: object) -> NoReturn:
    """Refuse a value of another type.

    Raises:
        DocumentError: names the type that was found.
    """
    shown = f" {str(value)[:40]!r}" if isinstance(value, str) else ""
    raise DocumentError(place, f"expected {expected}, found {json_type(value)}{shown}")


class _RepeatedName(Exception):
    def __init__(self, name: str) -> None:
        self.name = name[:60]


class _LongNumber(Exception):
    def __init__(self, digits: str) -> None:
        self.digits = digits


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        raise _RepeatedName(counts.most_common(1)[0][0])
    return data


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise _LongNumber(digits)
    return int(digits)


def _check_depth(data: object) -> None:
    """Raises: RecursionError: as json does itself for what is deeper still."""
    level = [data]
    for _ in range(MAX_DEPTH):
        level = [
            inner
            for item in level
            if isinstance(item, dict | list)
            for inner in (item.values() if isinstance(item, dict) else item)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise RecursionError
