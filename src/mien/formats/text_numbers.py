"""Text files of nothing but numbers, read with care: every complaint names the line."""

from __future__ import annotations

import math
from pathlib import Path

from mien.errors import FileFormatError, InputError

MOST = 100_000
"""No file of points means more; a number beyond is no count."""


def read_ascii(path: str | Path, expected: str) -> str:
    """The text of a file. Raises: InputError: unreadable. FileFormatError: other bytes; empty."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except UnicodeDecodeError:
        raise FileFormatError(path, f"expected {expected}, found other bytes") from None
    if not text.strip():
        raise FileFormatError(path, f"expected {expected}, found an empty file")
    return text


class Numbers:
    """Takes one number after the other from a file.

    Raises: InputError: the file cannot be read. FileFormatError: no text, empty.
    """

    def __init__(self, path: str | Path, expected: str, text: str | None = None) -> None:
        self._path = path
        text = read_ascii(path, expected) if text is None else text
        self._words = [(n, w) for n, row in enumerate(text.splitlines(), 1) for w in row.split()]
        self._next = 0

    @property
    def at_end(self) -> bool:
        """Whether none is left."""
        return self._next == len(self._words)

    def finite(self, what: str) -> float:
        """The next one. Raises: FileFormatError: none is left, no number, NaN or infinite."""
        if self.at_end:
            raise FileFormatError(self._path, f"ends before {what}")
        line, word = self._words[self._next]
        self._next += 1
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            problem = f"expected a finite number ({what}), found {word[:40]!r}"
            raise FileFormatError(self._path, problem, f"line {line}")
        return value

    def whole(self, what: str, *, least: int = 0, below: int = MOST) -> int:
        """The next one, whole and within these limits. Raises: FileFormatError."""
        value = self.finite(what)
        if not (value.is_integer() and least <= value < below):
            line, word = self._words[self._next - 1]
            expected = f"expected {what}, a whole number from {least} to {below - 1}"
            raise FileFormatError(self._path, f"{expected}, found {word[:40]!r}", f"line {line}")
        return int(value)

    def count(self, what: str) -> int:
        """The next one, a count of at least one. Raises: FileFormatError."""
        return self.whole(what, least=1)

    def expect_end(self) -> None:
        """Raises: FileFormatError: something is left."""
        if not self.at_end:
            line, word = self._words[self._next]
            raise FileFormatError(
                self._path, f"expected the end, found {word[:40]!r}", f"line {line}"
            )
