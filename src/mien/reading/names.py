"""Files and folders as a user sees them."""

from __future__ import annotations

import re
import stat
from pathlib import Path, PurePosixPath

from mien.errors import FileFormatError, InputError

_PLAINLESS = re.compile(r"[\x00-\x1f\x7f\\\ud800-\udfff]")

_SIGNATURES = (
    (b"%!PS", "PostScript"),
    (b"\xc5\xd0\xd3\xc6", "PostScript"),
    (b"%PDF", "a PDF"),
    (b"\xd7\xcd\xc6\x9a", "a Windows metafile"),
    (b"\xff\x0a", "JPEG XL"),
    (b"\0\0\0\x0cJXL ", "JPEG XL"),
    (b"PK\3\4", "a ZIP archive"),
    (b"II*\0", "a TIFF of a kind that is not read, or damaged"),
    (b"MM\0*", "a TIFF of a kind that is not read, or damaged"),
    (b"ID3", "music"),
)


def named_path(name: str, path: str | Path, expected: str) -> Path:
    """The path, unless nothing was given: Path("") would be the current folder.

    Args:
        name: of what the path is for.
        expected: what may lie there.

    Raises:
        InputError: an empty path, one that holds a NUL.
    """
    if not str(path):
        raise InputError(name, expected, "an empty name")
    if "\0" in str(path):
        raise InputError(repr(str(path)), expected, "a name that holds a NUL")
    return Path(path)


def check_regular(path: Path, kind: str) -> None:
    """Refuse what is there but is no file: opening a pipe or a device may wait for ever.

    Raises:
        InputError: a folder, a pipe, a device, a socket, a name that cannot be one.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or one_line(error)
        raise InputError(path, f"{kind} that can be read", reason) from None
    if not stat.S_ISREG(mode):
        raise InputError(path, kind, _irregular(mode))


def check_readable(path: Path, kind: str) -> None:
    """Raises: InputError: no such file, not a file, not allowed. FileFormatError: it is empty."""
    check_regular(path, kind)
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except FileNotFoundError:
        raise InputError(path, kind, "no such file") from None
    except OSError as error:
        raise InputError(path, f"{kind} that can be read", error.strerror or error) from None
    if empty:
        raise FileFormatError(path, f"expected {kind}, found an empty file")


def is_inside(path: str) -> bool:
    """Whether a relative path, with forward slashes, leads to somewhere below its folder."""
    plain = PurePosixPath(path)
    inside = bool(path) and not plain.is_absolute() and ".." not in plain.parts
    return inside and not set(path) & set("\\\0")


def plain_name(path: Path) -> str:
    """A file's name as every system can write it, within a path too: bytes that are no text,

    backslashes and control characters become %NN.
    """
    return _PLAINLESS.sub(lambda match: f"%{ord(match[0]) & 0xFF:02X}", path.name)


def kind_of(path: Path) -> str:
    """What a file that is not what it should be seems to be."""
    with path.open("rb") as file:
        head = file.read(512)
    for start, name in _SIGNATURES:
        if head.startswith(start):
            return f"something else ({name})"
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


def _irregular(mode: int) -> str:
    if stat.S_ISDIR(mode):
        return "a folder"
    if stat.S_ISFIFO(mode):
        return "a named pipe"
    return "a socket" if stat.S_ISSOCK(mode) else "a device"
