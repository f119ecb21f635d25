from __future__ import annotations

import pytest

from mien.app.options import check_finite, parse_amounts, parse_colour, parse_size
from mien.errors import InputError


def test_sizes() -> None:
    assert parse_size("--size", "800x1000") == (800, 1000)
    assert parse_size("--size", "1X8192") == (1, 8192)


@pytest.mark.parametrize("text", ["", "800", "x", "800x", "-1x5", "1.5x2", "0x4", "4x4x4", "²x4"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(InputError, match="--size: expected WIDTHxHEIGHT in px"):
        parse_size("--size", text)


def test_amounts() -> None:
    texts = ["jawOpen=0.5", "eyeBlinkLeft=-1e-1", "jawOpen=1"]
    assert parse_amounts("--unit", texts) == {"jawOpen": 1.0, "eyeBlinkLeft": -0.1}
    assert parse_amounts("--unit", []) == {}


@pytest.mark.parametrize("text", ["", "jawOpen", "=1", "jawOpen=", "jawOpen=1=2", "jawOpen=inf"])
def test_what_is_no_amount(text: str) -> None:
    with pytest.raises(InputError, match="--unit: expected NAME=AMOUNT"):
        parse_amounts("--unit", [text])


def test_colours() -> None:
    assert parse_colour("--background", "#204060") == (32, 64, 96)
    assert parse_colour("--background", "FFffff") == (255, 255, 255)


@pytest.mark.parametrize("text", ["", "#", "#2040", "#20406080", "red", "#gg0000"])
def test_what_is_no_colour(text: str) -> None:
    with pytest.raises(InputError, match="--background: expected a colour, as #204060"):
        parse_colour("--background", text)


def test_finite_numbers() -> None:
    assert check_finite("--yaw", -5.0) == -5.0
    with pytest.raises(InputError, match="--yaw: expected a finite number, got inf"):
        check_finite("--yaw", float("inf"))
