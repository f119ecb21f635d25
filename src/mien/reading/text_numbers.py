"""Text files of nothing but numbers, read strictly: every error names the line."""

from __future__ import annotations

import math
from pathlib import Path

from mien.errors import FileFormatError
from mien.limits import LARGEST, MAX_POINTS_BYTES
from mien.reading.csv_rows import number_in
from mien.reading.files import read_text

_MAX_COUNT = 100_000
"""Files of points hold fewer; a larger number is no count."""


class NumberReader:
    """The numbers of a file, read one after the other.

    Args:
        path: the file.
        expected: what kind of file it should be, for messages.
        text: of the file, if it is read already.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: no text, empty, too large.
    """

    def __init__(self, path: str | Path, expected: str, text: str | None = None) -> None:
        self._path = path
        text = read_text(path, MAX_POINTS_BYTES, expected) if text is None else text
        self._words = [(n, w) for n, row in enumerate(text.splitlines(), 1) for w in row.split()]
        self._next = 0

    @property
    def at_end(self) -> bool:
        """Whether no number is left."""
        return self._next == len(self._words)

    def finite(self, what: str) -> float:
        """The next number. Raises: FileFormatError: none is left, no number, NaN or infinite."""
        if self.at_end:
            raise FileFormatError(self._path, f"ends before {what}")
        line, word = self._words[self._next]
        self._next += 1
        value = number_in(word)
        if not math.isfinite(value):
            problem = f"expected a finite number ({what}), found {word[:40]!r}"
            raise FileFormatError(self._path, problem, f"line {line}")
        if abs(value) > LARGEST:
            limits = f"from {-LARGEST:g} to {LARGEST:g}"
            problem = f"expected a number {limits} ({what}), found {word[:40]}"
            raise FileFormatError(self._path, problem, f"line {line}")
        return value

    def whole(self, what: str, *, least: int = 0, below: int = _MAX_COUNT) -> int:
        """The next number, whole and within these limits. Raises: FileFormatError."""
        value = self.finite(what)
        if not (value.is_integer() and least <= value < below):
            line, word = self._words[self._next - 1]
            expected = f"expected {what}, a whole number from {least} to {below - 1}"
            raise FileFormatError(self._path, f"{expected}, found {word[:40]!r}", f"line {line}")
        return int(value)

    def count(self, what: str) -> int:
        """The next number, a count of at least one. Raises: FileFormatError."""
        return self.whole(what, least=1)

    def expect_end(self) -> None:
        """Raises: FileFormatError: something is left."""
        if not self.at_end:
            line, word = self._words[self._next]
            raise FileFormatError(
                self._path, f"expected the end, found {word[:40]!r}", f"line {line}"
            )
