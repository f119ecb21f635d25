"""CSV, read strictly: every error names line and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from mien.errors import FileFormatError, InputError
from mien.limits import LARGEST, MAX_LINE, MAX_TABLE_BYTES
from mien.reading.files import check_size


def read_rows(
    path: str | Path, expected: str, *, separators: str = ","
) -> Iterator[tuple[int, list[str]]]:
    """The number and the cells of every line that is not empty; lines count from 1.

    Args:
        path: the file.
        expected: what kind of file it should be, for messages.
        separators: of cells; the most frequent one in the first line is used.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: no CSV in UTF-8, an empty file, a file that is too large.
    """
    path, count = check_size(path, MAX_TABLE_BYTES), 0
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            first = next((line for line in stream if line.strip()), "")
            stream.seek(0)
            separator = max(separators, key=first.count)
            reader = csv.reader(_lines(path, stream), delimiter=separator, strict=True)
            for row in reader:
                if any(cell.strip() for cell in row):
                    count += 1
                    yield reader.line_num, row
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except (UnicodeDecodeError, csv.Error):
        raise FileFormatError(path, f"expected {expected}, found other bytes") from None
    if not count:
        raise FileFormatError(path, f"expected {expected}, found an empty file")


def _lines(path: Path, stream: TextIO) -> Iterator[str]:
    """The lines. Raises: FileFormatError: one is too long, as empty cells take much memory."""
    for number, line in enumerate(stream, 1):
        if len(line) > MAX_LINE:
            problem = f"expected lines of at most {MAX_LINE} letters, found {len(line)}"
            raise FileFormatError(path, problem, f"line {number}")
        yield line


def finite_number(path: str | Path, text: str, place: str) -> float:
    """The number in a cell.

    Raises:
        FileFormatError: none, NaN, infinite, larger than LARGEST; names the place.
    """
    value = number_in(text)
    if not math.isfinite(value):
        raise FileFormatError(path, f"expected a finite number, found {text[:40]!r}", place)
    if abs(value) > LARGEST:
        limits = f"from {-LARGEST:g} to {LARGEST:g}"
        raise FileFormatError(path, f"expected a number {limits}, found {text[:40]}", place)
    return value


def number_in(text: str) -> float:
    """The number in a text, without Python's own notations; NaN for none."""
    try:
        return math.nan if "_" in text or not text.isascii() else float(text)
    except ValueError:
        return math.nan
