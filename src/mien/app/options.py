"""Command-line values that are more than one number."""

from __future__ import annotations

from math import isfinite

from mien.errors import InputError

MAX_SIDE = 8192
"""Of a rendered picture, px."""


def check_finite(name: str, value: float) -> float:
    """The value. Raises: InputError: infinite or not a number, both of which parse as floats."""
    if not isfinite(value):
        raise InputError(name, "a finite number", value)
    return value


def parse_size(name: str, text: str) -> tuple[int, int]:
    """`800x1000` to (800, 1000). Raises: InputError."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise InputError(name, "WIDTHxHEIGHT in px, as 800x1000", text)
    if max(int(width), int(height)) > MAX_SIDE:
        raise InputError(name, f"at most {MAX_SIDE} px a side", text)
    return int(width), int(height)


def parse_amounts(name: str, texts: list[str]) -> dict[str, float]:
    """`["jawOpen=0.5"]` to {"jawOpen": 0.5}. Raises: InputError."""
    amounts = {}
    for text in texts:
        key, equals, value = text.partition("=")
        try:
            if not (key and equals and isfinite(float(value))):
                raise ValueError
        except ValueError:
            raise InputError(name, "NAME=AMOUNT, as jawOpen=0.5", text) from None
        amounts[key] = float(value)
    return amounts


def parse_colour(name: str, text: str) -> tuple[int, int, int]:
    """`#204060` to (32, 64, 96). Raises: InputError."""
    digits = text.removeprefix("#")
    try:
        red, green, blue = bytes.fromhex(digits)
    except ValueError:
        raise InputError(name, "a colour, as #204060", text) from None
    return red, green, blue
