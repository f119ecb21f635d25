"""What can go wrong, in the user's terms. Every message is one line."""

from __future__ import annotations

import re
from pathlib import Path

_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")
_BYTE = 0xDC00  # where Python puts the bytes of a file's name that are no text


def one_line(message: object) -> str:
    """A library's message without its line breaks."""
    return " ".join(str(message).split())


def escaped(text: str) -> str:
    r"""Text that any file in UTF-8 can hold and any terminal can show.

    Bytes that are no text, and control characters, are written as \xNN.
    """

    def name(match: re.Match[str]) -> str:
        code = ord(match[0])
        code -= _BYTE if _BYTE + 0x80 <= code < _BYTE + 0x100 else 0
        return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"

    return _UNPRINTABLE.sub(name, text)


class MienError(Exception):
    """Base of every error that mien raises on purpose."""


class InputError(MienError, ValueError):
    """A value the caller gave is not what was expected.

    Attributes:
        name: the argument, option or file at fault.
        expected: what would have been accepted.
        got: what was found instead.
    """

    def __init__(self, name: str | Path, expected: str, got: object) -> None:
        self.name, self.expected, self.got = str(name), expected, str(got)
        super().__init__(escaped(f"{self.name}: expected {expected}, got {self.got}"))


class FileFormatError(MienError):
    """A file does not hold what its kind promises.

    Attributes:
        path: the file.
        place: where in it (a key, a line, a frame), or "".
        problem: what was expected and what was found.
    """

    def __init__(self, path: str | Path, problem: str, place: str = "") -> None:
        self.path, self.place, self.problem = Path(path), place, problem
        super().__init__(escaped(f"{path}: {place + ': ' if place else ''}{problem}"))


class OtherPointsError(FileFormatError):
    """A whole file of points, but of a kind whose relation to mien's points is not known."""


class EstimationError(MienError):
    """The data do not determine what is asked for; the message says why."""


class DocumentError(Exception):
    """An unexpected value at a place of a document; the reader of the file adds the file's name."""

    def __init__(self, place: str, problem: str) -> None:
        self.place, self.problem = place, problem
        super().__init__(f"{place}: {problem}")
