from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from mien.errors import InputError
from mien.expression_names import check_expression_folders, is_plain_name, name_problem


@pytest.mark.parametrize(
    "name",
    ["neutral", "joy", "a=b", "mouth wide", "Überrascht", "笑顔", "x" * 200, "joy-2.1", "face"],
)
def test_names_that_can_be_used(name: str) -> None:
    assert name_problem(name) == ""
    assert is_plain_name(name)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("mouth:wide", "':' in it"),
        ("50%?", "'?' in it"),
        ("a\\b", "'\\\\' in it"),
        ("a\nb", "'\\n' in it"),
        ("J\udcfcrgen", "'\\udcfc' in it"),
        (" joy", "a dot or a space at its beginning"),
        ("..joy", "a dot or a space at its beginning"),
        ("joy.", "a dot or a space at its end"),
        ("joy ", "a dot or a space at its end"),
        ("é" * 101, "202 bytes, of which 200 are the most"),
        ("CON", "that of a device on Windows"),
        ("lpt1.old", "that of a device on Windows"),
        ("Atlas", "that of a texture of the neutral face"),
    ],
)
def test_names_that_cannot(name: str, problem: str) -> None:
    assert name_problem(name) == problem
    with pytest.raises(InputError) as caught:
        check_expression_folders([Path("photos/joy2"), Path("photos", name)])
    shown = str(Path("photos", name)).replace("\udcfc", "\\xfc")
    assert str(caught.value) == f"{shown}: expected the name of an expression, got {problem}"


@pytest.mark.parametrize(
    "names",
    [
        ("Joy", "joy"),
        ("Neutral", "neutral"),
        ("STRASSE", "straße"),
        (unicodedata.normalize("NFD", "fâché"), unicodedata.normalize("NFC", "fâché")),
    ],
)
def test_names_that_some_file_systems_take_for_one(names: tuple[str, str]) -> None:
    one, other = (Path("photos", name) for name in names)
    with pytest.raises(InputError) as caught:
        check_expression_folders([Path("photos/rest"), one, other])
    assert str(caught.value) == (
        f"{other}: expected another name than that of {names[0]}, got the same but for case or "
        "accents"
    )
