"""CSV that is read with care: every complaint names line and column."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from mien.errors import FileFormatError, InputError


def read_rows(path: str | Path, expected: str) -> list[list[str]]:
    """The cells of every line, at least of one.

    Args:
        expected: what kind of file it should be, for messages.
    Raises: InputError: the file cannot be read. FileFormatError: no CSV in UTF-8, an empty file.
    """
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
        rows = list(csv.reader(io.StringIO(text, newline=""), strict=True))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    except (UnicodeDecodeError, csv.Error):
        raise FileFormatError(path, f"expected {expected}, found other bytes") from None
    if not rows:
        raise FileFormatError(path, f"expected {expected}, found an empty file")
    return rows


def finite_number(path: str | Path, text: str, place: str) -> float:
    """The number in a cell. Raises: FileFormatError: none, NaN or infinite; names the place."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileFormatError(path, f"expected a finite number, found {text[:40]!r}", place)
    return value
