"""Files and folders as a user sees them."""

from __future__ import annotations

import re
from pathlib import Path

from mien.errors import FileFormatError, InputError

_PLAINLESS = re.compile(r"[\x00-\x1f\x7f\\\ud800-\udfff]")


def check_readable(path: Path, kind: str) -> None:
    """Raises: InputError: no such file, or not allowed. FileFormatError: it is empty."""
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except FileNotFoundError:
        raise InputError(path, kind, "no such file") from None
    except IsADirectoryError:
        raise InputError(path, kind, "a folder") from None
    except OSError as error:
        raise InputError(path, f"{kind} that can be read", error.strerror or error) from None
    except ValueError:
        raise InputError(path, "a file's name", "one with a NUL in it") from None
    if empty:
        raise FileFormatError(path, f"expected {kind}, found an empty file")


def plain_name(path: Path) -> str:
    """A file's name as every system can write it, within a path too: bytes that are no text,
    backslashes and control characters become %NN.
    """
    return _PLAINLESS.sub(lambda match: f"%{ord(match[0]) & 0xFF:02X}", path.name)


def kind_of(path: Path) -> str:
    """What a file that is not what it should be seems to be."""
    with path.open("rb") as file:
        head = file.read(512)
    plain = all(32 <= byte < 127 or byte in b"\t\r\n" for byte in head)
    return "a text file" if plain else "something else or a damaged start"


def one_line(message: object) -> str:
    """A library's message without its line breaks."""
    return " ".join(str(message).split())


def listed(folder: Path) -> list[Path]:
    """What is not hidden, in natural order: photo_2 before photo_10. Raises: InputError."""
    try:
        paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError as error:
        raise InputError(folder, "a readable folder", error.strerror or error) from None
    return sorted(paths, key=lambda path: natural_key(path.name))


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """A sorting key in which digits count as numbers."""
    parts = re.split(r"([0-9]+)", name.lower())
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts if part]
