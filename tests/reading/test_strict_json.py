"""The one reader of JSON: whatever a file holds, one line tells what and where."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from mien.errors import DocumentError, FileFormatError, InputError
from mien.limits import MAX_CONTAINERS, MAX_DEPTH, MAX_DIGITS, MAX_JSON_BYTES
from mien.reading.strict_json import (
    DocumentFormat,
    JsonValue,
    errors_name_file,
    read_json,
    unknown_name,
)


def read(folder: Path, content: bytes) -> dict:
    path = folder / "a.json"
    path.write_bytes(content)
    return read_json(path)


def nested(depth: int) -> bytes:
    return b'{"a": ' + b"[" * (depth - 1) + b"]" * (depth - 1) + b"}"


def test_the_deepest_and_the_longest_pass(tmp_path: Path) -> None:
    assert read(tmp_path, b'\xef\xbb\xbf{"a": 1}') == {"a": 1}
    read(tmp_path, nested(MAX_DEPTH))
    assert read(tmp_path, b'{"a": %s}' % (b"7" * MAX_DIGITS))["a"] > 10**999


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "expected JSON in UTF-8, found an empty file"),
        (b"{\n x", "line 2, column 2: expected JSON: "),
        (b"[1]", "expected an object, found a list"),
        (b"null", "expected an object, found null"),
        (b'{"a": {"b": 1, "b": 2}}', "b: the name appears twice"),
        (b"\xff\xfe{}", "expected JSON in UTF-8, found other bytes"),
        (nested(MAX_DEPTH + 1), "expected lists and objects at most 64 deep, found deeper ones"),
        (nested(900), "expected lists and objects at most 64 deep, found deeper ones"),
        (b"[" * 200_000, "expected lists and objects at most 64 deep, found deeper ones"),
        (b'{"a":' * 200_000, "expected lists and objects at most 64 deep, found deeper ones"),
        (
            b'{"a":\n%s}' % (b"7" * 5000),
            "line 2: expected numbers of at most 1000 digits, found 5000",
        ),
    ],
    ids=lambda value: str(value)[:40],
)
def test_an_error_is_one_line(tmp_path: Path, content: bytes, problem: str) -> None:
    with pytest.raises(FileFormatError) as caught:
        read(tmp_path, content)
    assert str(caught.value).startswith(f"{tmp_path / 'a.json'}: {problem}")
    assert "\n" not in str(caught.value)


def test_too_large_a_document_is_refused_at_once(tmp_path: Path) -> None:
    start = time.perf_counter()
    with pytest.raises(FileFormatError, match="expected at most 4000000 lists and objects"):
        read(tmp_path, b'{"a": [%s]}' % (b"[]," * MAX_CONTAINERS))
    with pytest.raises(FileFormatError, match=r"expected at most 64 MiB, found 64\.0"):
        read(tmp_path, b" " * (MAX_JSON_BYTES + 1))
    assert time.perf_counter() - start < 2


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a readable file, got No such file"):
        read_json(tmp_path / "none.json")
    with pytest.raises(InputError, match="expected a readable file, got a folder"):
        read_json(tmp_path)
    with pytest.raises(InputError, match="a name that none can have"):
        read_json("a\0b.json")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.json")
        with pytest.raises(InputError, match="expected a readable file, got a pipe"):
            read_json(tmp_path / "pipe.json")


def test_the_largest_documents_are_read_in_seconds(tmp_path: Path) -> None:
    start = time.perf_counter()
    count = MAX_CONTAINERS - 10
    assert len(read(tmp_path, b'{"a": [%s{}]}' % (b"{}," * count))["a"]) == count + 1
    assert time.perf_counter() - start < 10


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity", "1e999", "1" * 400])
def test_numbers_that_are_not_finite_are_refused_with_their_place(text: str) -> None:
    with pytest.raises(DocumentError, match=r"a\[1\]: expected a finite number, found (nan|-?inf)"):
        JsonValue(json.loads(f"[1, {text}]"), "a").array(2)


def test_limits_of_numbers() -> None:
    assert JsonValue(1, "a").number(least=0, most=1) == 1.0
    with pytest.raises(DocumentError, match=r"a: expected a number from -0\.5 to 1\.5, found 50"):
        JsonValue(50, "a").number(least=-0.5, most=1.5)
    with pytest.raises(DocumentError, match="a: expected a number above 0 and at most 10, found 0"):
        JsonValue(0, "a").number(above=0, most=10)
    limits = r"from -1e\+09 to 1e\+09"
    with pytest.raises(DocumentError, match=rf"a: expected a number {limits}, found 1e\+30"):
        JsonValue(10**30, "a").number()
    for value in (True, 1.5, "1", None):
        with pytest.raises(DocumentError, match="a: expected a whole number, found "):
            JsonValue(value, "a").whole()


def test_arrays_have_the_shape_that_is_expected() -> None:
    np.testing.assert_array_equal(
        JsonValue([[1, 2.5], [3, 4]], "a").array(2, 2), [[1, 2.5], [3, 4]]
    )
    with pytest.raises(DocumentError, match="a: expected 2 lists, found 1"):
        JsonValue([[1, 2]], "a").array(2, 2)
    with pytest.raises(DocumentError, match=r"a\[1\]: expected 2 numbers, found 3"):
        JsonValue([[1, 2], [3, 4, 5]], "a").array(2, 2)
    with pytest.raises(DocumentError, match=r"a\[0\]\[1\]: expected a number, found true or false"):
        JsonValue([[1, True], [3, 4]], "a").array(2, 2)


def test_names_are_there_once() -> None:
    assert JsonValue(["a", "b"], "parts").names() == ("a", "b")
    with pytest.raises(DocumentError, match="parts: 'a' appears twice"):
        JsonValue(["a", "b", "a"], "parts").names()
    with pytest.raises(DocumentError, match=r"parts\[1\]: expected text, found null"):
        JsonValue(["a", None], "parts").names()


def test_names_of_a_million_letters_are_cut_short() -> None:
    start = time.perf_counter()
    assert len(unknown_name("unit", "a" * 1_000_000, [f"unit{i}" for i in range(1000)])) < 300
    assert time.perf_counter() - start < 1


def test_a_format_is_that_of_its_header(tmp_path: Path) -> None:
    format = DocumentFormat("mien thing", 2)
    for version in (1, 2):
        format.check(JsonValue(format.header | {"version": version}))
    path = tmp_path / "a.json"
    path.write_text(json.dumps(format.header | {"version": 3}))
    assert format.is_in(path), "of whatever version"
    for other in ('{"format": "mien head"}', "[]", ""):
        path.write_text(other)
        assert not format.is_in(path)
    assert not format.is_in(tmp_path / "nothing.json")
    with pytest.raises(DocumentError, match="format: expected 'mien thing', found 'mien head'"):
        format.check(JsonValue({"format": "mien head"}))
    with pytest.raises(DocumentError, match="version: 3 was written by a newer mien"):
        format.check(JsonValue(format.header | {"version": 3}))


@pytest.mark.parametrize("error", [DocumentError("a", "expected b"), InputError("a", "b", "c")])
def test_errors_of_a_document_name_its_file(error: Exception) -> None:
    for line, place in ((None, "a: expected b"), (3, "line 3, a: expected b")):
        with (
            pytest.raises(FileFormatError, match=rf"^x\.json: {place}"),
            errors_name_file("x.json", line),
        ):
            raise error
