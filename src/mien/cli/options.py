"""Parsers and checks of command-line values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import inf, isfinite, radians
from typing import TYPE_CHECKING

from mien.errors import InputError
from mien.limits import LARGEST, MAX_SIDE

if TYPE_CHECKING:
    from mien.rig.state import FaceState

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)


def check_given(arguments: Sequence[str]) -> None:
    """Refuse arguments that are empty, which as a path would mean the current folder, or hold NUL.

    Raises:
        InputError: with the option, or the position of the argument.
    """
    for place, argument in enumerate(arguments):
        before = arguments[place - 1] if place else ""
        if argument == "":
            name = (
                before if before.startswith("-") else f"argument {place} of `mien {arguments[0]}`"
            )
            raise InputError(name, "something", "an empty argument")
        if argument.startswith("--") and argument.endswith("="):
            raise InputError(argument[:-1], "something after =", "nothing")
        if "\0" in argument:
            raise InputError("arguments", "text without NUL", argument)


def check_finite(name: str, value: float) -> float:
    """The value.

    Raises:
        InputError: infinite or not a number, both of which parse as floats.
    """
    if not isfinite(value):
        raise InputError(name, "a finite number", value)
    return value


def check_seconds(name: str, value: float | None) -> None:
    """Raises: InputError: no time that passes, if one is given at all."""
    if value is not None and not 0 < value < inf:
        raise InputError(name, "a number of seconds above 0", f"{value:g}")


def parse_size(name: str, text: str) -> tuple[int, int]:
    """`800x1000` to (800, 1000). Raises: InputError."""
    width, cross, height = text.lower().partition("x")
    sides = _whole(width), _whole(height)
    if not (cross and all(sides)):
        raise InputError(name, "WIDTHxHEIGHT in px, as 800x1000", text[:40])
    if max(sides) > MAX_SIDE:
        raise InputError(name, f"at most {MAX_SIDE} px a side", text[:40])
    return sides


def _whole(text: str) -> int:
    """The number of up to 20 digits; 0 for other text."""
    return int(text[:20]) if text.isascii() and text.isdecimal() else 0


def parse_amounts(
    name: str, texts: list[str], *, expected: str = "NAME=AMOUNT, as jawOpen=0.5"
) -> dict[str, float]:
    """`["jawOpen=0.5"]` to {"jawOpen": 0.5}. Raises: InputError."""
    amounts = {}
    for text in texts:
        # A name may have an equals sign in it, an amount has none.
        key, equals, value = text.rpartition("=")
        amount = float(value) if _NUMBER.fullmatch(value.strip()) else inf
        if not (key and equals and isfinite(amount)):
            raise InputError(name, expected, text[:80])
        amounts[key] = amount
    return amounts


def parse_regions(name: str, texts: list[str]) -> dict[str, dict[str, float]]:
    """`["mouth:anger=0.4"]` to {"mouth": {"anger": 0.4}}. Raises: InputError."""
    expected = "REGION:NAME=AMOUNT, as mouth:anger=0.4"
    regions: dict[str, dict[str, float]] = {}
    for key, amount in parse_amounts(name, texts, expected=expected).items():
        region, colon, expression = key.partition(":")
        if not (region and colon and expression):
            raise InputError(name, expected, f"{key}={amount:g}")
        regions.setdefault(region, {})[expression] = amount
    return regions


def parse_angles(name: str, text: str) -> tuple[float, float]:
    """`10,-5` in degrees to radians. Raises: InputError."""
    try:
        yaw, pitch = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(name, "YAW,PITCH in degrees, as 10,-5", text[:40]) from None
    return radians(check_finite(name, yaw)), radians(check_finite(name, pitch))


def parse_state(
    expressions: list[str] | None,
    regions: list[str] | None,
    units: list[str] | None,
    gaze: str | None,
) -> FaceState:
    """The state of a face from the options of `mien render`. Raises: InputError."""
    from mien.rig.state import FACE, FaceState, Gaze

    everywhere = parse_amounts(
        "--expression", expressions or [], expected="NAME=AMOUNT, as joy=0.6"
    )
    by_region = parse_regions("--region", regions or [])
    if everywhere:
        by_region[FACE] = everywhere | by_region.get(FACE, {})
    amounts = parse_amounts("--unit", units or [])
    yaw, pitch = (0.0, 0.0) if gaze is None else parse_angles("--gaze", gaze)
    return FaceState(by_region, amounts, Gaze(yaw, pitch))


def parse_count(name: str, text: str | None) -> int | None:
    """`none` to 0, `5` to 5, nothing to None. Raises: InputError."""
    if text is None:
        return None
    if text.lower() == "none":
        return 0
    if not 0 < (count := _whole(text)) < LARGEST:
        raise InputError(name, "a number from 1 up, or none", text[:40])
    return count


def parse_colour(name: str, text: str) -> tuple[int, int, int]:
    """`#204060` to (32, 64, 96). Raises: InputError."""
    digits = text.removeprefix("#")
    try:
        red, green, blue = bytes.fromhex(digits)
    except ValueError:
        raise InputError(name, "a colour, as #204060", text[:40]) from None
    return red, green, blue
