"""Paths and names of files, as users give them and as every system can write them."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from mien.errors import InputError

_NOT_PORTABLE = re.compile(r"[\x00-\x1f\x7f\\\ud800-\udfff]")


def check_path(name: str, path: str | Path, expected: str) -> Path:
    """The path, unless nothing was given: Path("") would be the current folder.

    Args:
        name: of what the path is for.
        path: as the user gives it.
        expected: what may lie there.

    Raises:
        InputError: an empty path, one that holds a NUL.
    """
    if not str(path):
        raise InputError(name, expected, "an empty name")
    if "\0" in str(path):
        raise InputError(repr(str(path)), expected, "a name that holds a NUL")
    return Path(path)


def is_inside(path: str) -> bool:
    """Whether a relative path, with forward slashes, leads to somewhere below its folder."""
    plain = PurePosixPath(path)
    inside = bool(path) and not plain.is_absolute() and ".." not in plain.parts
    return inside and not set(path) & set("\\\0")


def portable_name(path: Path) -> str:
    """A file's name as every system can write it, within a path too.

    Bytes that are no text, backslashes and control characters become %NN.
    """
    return _NOT_PORTABLE.sub(lambda match: f"%{ord(match[0]) & 0xFF:02X}", path.name)


def list_folder(folder: Path) -> list[Path]:
    """What is not hidden, in natural order: photo_2 before photo_10. Raises: InputError."""
    try:
        paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError as error:
        raise InputError(folder, "a readable folder", error.strerror or error) from None
    return sorted(paths, key=lambda path: _natural_sort_key(path.name))


def _natural_sort_key(name: str) -> list[tuple[int, int | str]]:
    """A key in which digits count as numbers."""
    parts = re.split(r"([0-9]+)", name.lower())
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts if part]
