"""Tables as other programs write them, and what is none."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from mien.errors import FileFormatError, InputError
from mien.limits import MAX_LINE
from mien.reading.csv_rows import finite_number, number_in, read_rows


def rows_of(folder: Path, content: bytes, separators: str = ",;\t") -> list[tuple[int, list[str]]]:
    (folder / "a.csv").write_bytes(content)
    return list(read_rows(folder / "a.csv", "a table", separators=separators))


def test_rows_with_their_lines(tmp_path: Path) -> None:
    found = [(1, ["a", "b"]), (3, ["1", "2"]), (5, ["3", "4\n5"])]
    assert rows_of(tmp_path, b'\xef\xbb\xbfa,b\r\n\r\n1,2\r\n3,"4\n5"\r\n,\r\n') == found
    assert rows_of(tmp_path, b"a;b;c,d\n1;2;3") == [(1, ["a", "b", "c,d"]), (2, ["1", "2", "3"])]
    assert rows_of(tmp_path, b"a\tb\n1\t2") == [(1, ["a", "b"]), (2, ["1", "2"])]
    assert rows_of(tmp_path, b"a;b\n", ",") == [(1, ["a;b"])]


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "expected a table, found an empty file"),
        (b"\n,,\n", "expected a table, found an empty file"),
        ("a,b\n1,2".encode("utf-16"), "expected a table, found other bytes"),
        (b'a,"b\n1,2', "expected a table, found other bytes"),
        (b"a,b\n" + b"," * MAX_LINE + b"\n", "line 2: expected lines of at most 1048576 letters"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes, problem: str) -> None:
    with pytest.raises(FileFormatError) as caught:
        rows_of(tmp_path, content)
    assert str(caught.value).startswith(f"{tmp_path / 'a.csv'}: {problem}")


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a readable file, got a folder"):
        list(read_rows(tmp_path, "a table"))


@pytest.mark.parametrize("text", ["", "x", "1_000", "٣", "nan", "inf", "1e999", "1,5", "0x10"])
def test_what_is_no_number_is_refused(text: str) -> None:
    assert not math.isfinite(number_in(text))
    with pytest.raises(
        FileFormatError, match=r"a\.csv: line 2, time: expected a finite number, fo"
    ):
        finite_number("a.csv", text, "line 2, time")


def test_numbers_have_limits() -> None:
    assert finite_number("a.csv", " -1.5e3", "line 2") == -1500
    with pytest.raises(
        FileFormatError, match=r"expected a number from -1e\+09 to 1e\+09, found 1e10"
    ):
        finite_number("a.csv", "1e10", "line 2")
