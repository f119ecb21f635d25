"""Files as bytes: no more of them than expected, and nothing that waits for ever."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from mien.errors import FileFormatError, InputError
from mien.limits import MIB

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


def check_regular(path: Path, kind: str = "") -> os.stat_result:
    """The status of a regular file: opening a pipe or a device may wait for ever.

    Args:
        path: the file.
        kind: what it should be, for messages: `a photo`; "" for any file.

    Raises:
        InputError: there is none, or a folder, a pipe, a device, a socket; a name that none can
            have.
    """
    readable = f"{kind} that can be read" if kind else "a readable file"
    try:
        status = path.stat()
    except OSError as error:
        if kind and isinstance(error, FileNotFoundError):
            raise InputError(path, kind, "no such file") from None
        raise InputError(path, readable, error.strerror or error) from None
    except ValueError:
        raise InputError(ascii(str(path)), readable, "a name that none can have") from None
    if not stat.S_ISREG(status.st_mode):
        raise InputError(path, kind or readable, _irregular(status.st_mode, named=bool(kind)))
    return status


def check_readable(path: Path, kind: str) -> None:
    """Refuse what cannot be read as a file of some kind.

    Args:
        path: the file.
        kind: what it should be, for messages: `a photo`.

    Raises:
        InputError: as check_regular; it may not be read.
        FileFormatError: it is empty.
    """
    check_regular(path, kind)
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise InputError(path, f"{kind} that can be read", error.strerror or error) from None
    if empty:
        raise FileFormatError(path, f"expected {kind}, found an empty file")


def check_size(path: str | Path, most: int) -> Path:
    """The path of a regular file of at most so many bytes.

    Raises:
        InputError: as check_regular.
        FileFormatError: a larger one.
    """
    path = Path(path)
    size = check_regular(path).st_size
    if size > most:
        problem = f"expected at most {most / MIB:g} MiB, found {size / MIB:.1f}"
        raise FileFormatError(path, problem)
    return path


def is_missing(path: str | Path) -> bool:
    """Whether nothing is there, as opposed to something that cannot be reached."""
    try:
        Path(path).stat()
    except (FileNotFoundError, NotADirectoryError):
        return True
    except (OSError, ValueError):
        return False
    return False


def read_bytes(path: str | Path, most: int) -> bytes:
    """All of a file of at most so many bytes.

    Raises:
        InputError: as check_size; it may not be read.
        FileFormatError: a larger one.
    """
    path = check_size(path, most)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None


def read_text(path: str | Path, most: int, expected: str) -> str:
    """The text of a file in UTF-8, without the byte order mark that it may begin with.

    Args:
        path: the file.
        most: bytes that it may have.
        expected: what kind of file it should be, for messages.

    Raises:
        InputError: as read_bytes.
        FileFormatError: other bytes, an empty file, a larger one.
    """
    try:
        text = read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError(path, f"expected {expected}, found other bytes") from None
    if not text.strip():
        raise FileFormatError(path, f"expected {expected}, found an empty file")
    return text


def describe_content(path: Path) -> str:
    """What a file that is not what it should be seems to be, by its first bytes."""
    with path.open("rb") as file:
        head = file.read(512)
    for start, name in _SIGNATURES:
        if head.startswith(start):
            return f"something else ({name})"
    is_text = all(32 <= byte < 127 or byte in b"\t\r\n" for byte in head)
    return "a text file" if is_text else "something else or a damaged start"


def _irregular(mode: int, *, named: bool) -> str:
    """What is there instead of a file; of pipes and the like, the very kind if `named`."""
    if stat.S_ISDIR(mode):
        return "a folder"
    if not named:
        return "a pipe, a device or the like"
    if stat.S_ISFIFO(mode):
        return "a named pipe"
    return "a socket" if stat.S_ISSOCK(mode) else "a device"
