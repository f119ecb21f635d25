"""Files as bytes: no more of them than expected, and nothing that waits for ever."""

from __future__ import annotations

import stat
from pathlib import Path

from mien.errors import FileFormatError, InputError
from mien.limits import MIB


def check_file(path: str | Path, most: int) -> Path:
    """The path of a file that can be read to its end.

    Args:
        most: bytes that it may have.

    Raises:
        InputError: there is none, or a folder, a pipe, a device.
        FileFormatError: a larger one.
    """
    path = Path(path)
    try:
        found = path.stat()
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except ValueError:
        raise InputError(ascii(str(path)), "a readable file", "a name that none can have") from None
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe, a device or the like"
        raise InputError(path, "a readable file", kind)
    if found.st_size > most:
        problem = f"expected at most {most / MIB:g} MiB, found {found.st_size / MIB:.1f}"
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
    """All of a file. Raises: as check_file; InputError: it cannot be read."""
    path = check_file(path, most)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None


def read_text(path: str | Path, most: int, expected: str) -> str:
    """The text of a file in UTF-8, without the mark that it may begin with.

    Args:
        expected: what kind of file it should be, for messages.

    Raises:
        as read_bytes; FileFormatError: other bytes, an empty file.
    """
    try:
        text = read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError(path, f"expected {expected}, found other bytes") from None
    if not text.strip():
        raise FileFormatError(path, f"expected {expected}, found an empty file")
    return text
