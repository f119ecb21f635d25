"""JSON, read strictly: every error names its place in the document."""

from __future__ import annotations

import difflib
import json
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
    """The value of a JSON text. NaN and infinity pass here; JsonValue.number refuses them.

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

    def check(self, document: JsonValue) -> None:
        """Raises: DocumentError: another format than this one, or a newer version of it."""
        stated = document.get("format", None)
        if stated.raw != self.name:
            raise stated.error(f"expected {self.name!r}, found {str(stated.raw)[:40]!r}")
        version = document.get("version", None)
        if version.whole(above=0) > self.version:
            by = f" ({str(document['generator'].raw)[:40]})" if "generator" in document else ""
            limit = f"this one reads up to {self.version}"
            raise version.error(f"{version.raw} was written by a newer mien{by}; {limit}")

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


@dataclass(frozen=True)
class JsonValue:
    """A value in a JSON document; every error names its place.

    Attributes:
        raw: as json reads it.
        place: in the document, as `expressions.joy.cameras[0]`; "" for the document itself.
    """

    raw: Any
    place: str = ""

    def members(self, keys: Iterable[str] | None = None) -> dict[str, JsonValue]:
        """Of an object with none but these keys. Raises: DocumentError: suggests the nearest."""
        if not isinstance(self.raw, dict):
            raise self.unexpected("an object")
        if keys is not None:
            known = tuple(keys)
            for key in self.raw:
                if key not in known:
                    raise DocumentError(join(self.place, key), unknown_name("key", key, known))
        return {key: JsonValue(value, join(self.place, key)) for key, value in self.raw.items()}

    def items(self) -> list[JsonValue]:
        """Of a list. Raises: DocumentError."""
        if not isinstance(self.raw, list):
            raise self.unexpected("a list")
        return [JsonValue(item, f"{self.place}[{i}]") for i, item in enumerate(self.raw)]

    def __contains__(self, key: str) -> bool:
        if not isinstance(self.raw, dict):
            raise self.unexpected("an object")
        return key in self.raw

    def __getitem__(self, key: str) -> JsonValue:
        """The member of this name. Raises: DocumentError: there is none."""
        place = join(self.place, key)
        if key not in self:
            raise DocumentError(place, "missing")
        return JsonValue(self.raw[key], place)

    def get(self, key: str, default: object) -> JsonValue:
        """The member of this name, or a default in its place. Raises: DocumentError."""
        return self[key] if key in self else JsonValue(default, join(self.place, key))

    def text(self) -> str:
        """Text. Raises: DocumentError."""
        if not isinstance(self.raw, str):
            raise self.unexpected("text")
        return self.raw

    def choice(self, kind: str, names: Collection[str]) -> str:
        """One of these names. Raises: DocumentError: suggests the nearest ones."""
        name = self.text()
        if name not in names:
            raise self.error(unknown_name(kind, name, names))
        return name

    def number(
        self, *, above: float | None = None, least: float = -LARGEST, most: float = LARGEST
    ) -> float:
        """A finite number above one limit or from the other on. Raises: DocumentError."""
        if isinstance(self.raw, bool) or not isinstance(self.raw, int | float):
            raise self.unexpected("a number")
        try:
            number = float(self.raw)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(f"expected a finite number, found {number}")
        if above is not None and not above < number <= most:
            limits = f"above {above:g} and at most {most:g}"
            raise self.error(f"expected a number {limits}, found {number:g}")
        if not least <= number <= most:
            raise self.error(f"expected a number from {least:g} to {most:g}, found {number:g}")
        return number

    def whole(
        self, *, above: float | None = None, least: float = -LARGEST, most: float = LARGEST
    ) -> int:
        """A whole number within these limits. Raises: DocumentError."""
        if isinstance(self.raw, bool) or not isinstance(self.raw, int):
            raise self.unexpected("a whole number")
        self.number(above=above, least=least, most=most)
        return self.raw

    def array(self, *shape: int) -> Array:
        """Nested lists of finite numbers as an array of this shape. Raises: DocumentError."""
        if not shape:
            return np.array(self.number())
        items = self.items()
        if len(items) != shape[0]:
            what = "numbers" if len(shape) == 1 else "lists"
            raise self.error(f"expected {shape[0]} {what}, found {len(items)}")
        rows = [item.array(*shape[1:]) for item in items]
        return np.array(rows, dtype=np.float64).reshape(shape)

    def names(self) -> tuple[str, ...]:
        """A list of texts, each once. Raises: DocumentError."""
        names = tuple(item.text() for item in self.items())
        for name, count in Counter(names).items():
            if count > 1:
                raise self.error(f"{name[:60]!r} appears twice")
        return names

    def error(self, problem: str) -> DocumentError:
        """That of this problem in this place."""
        return DocumentError(self.place, problem)

    def unexpected(self, expected: str) -> DocumentError:
        """That of a value of another type; names the type that was found."""
        shown = f" {str(self.raw)[:40]!r}" if isinstance(self.raw, str) else ""
        return self.error(f"expected {expected}, found {json_type(self.raw)}{shown}")


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
