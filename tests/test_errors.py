"""Messages are text that any terminal and any file can take."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mien.errors import FileFormatError, InputError, escaped


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Jürgen 日 😀\t\n", "Jürgen 日 😀\t\n"),
        (b"J\xfcrgen".decode("utf-8", "surrogateescape"), "J\\xfcrgen"),
        ("\ud83d", "\\ud83d"),
        ("\x1b[2J\0\x9b", "\\x1b[2J\\x00\\x9b"),
    ],
)
def test_what_is_no_text_is_escaped(text: str, shown: str) -> None:
    assert escaped(text) == shown
    assert escaped(shown) == shown
    shown.encode("utf-8")


def test_errors_name_their_file_escaped() -> None:
    path = Path(os.fsdecode(b"J\xfc.json"))
    assert str(InputError(path, "x", "y")) == "J\\xfc.json: expected x, got y"
    assert str(FileFormatError(path, "broken", "line 1")) == "J\\xfc.json: line 1: broken"
    assert FileFormatError(path, "broken").path == path
