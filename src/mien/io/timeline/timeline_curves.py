"""Curves in timeline documents: a number, a list of keys, or keys and their interpolation."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from mien.animate.curves import INTERPOLATIONS, MIN_STEP, Curve, constant
from mien.errors import DocumentError
from mien.reading.strict_json import (
    as_choice,
    as_list,
    as_number,
    as_object,
    need,
    raise_unexpected,
)

_KEY = ("time", "value", "interpolation", "in", "out")


def curve_from_json(value: object, place: str) -> Curve:
    """The curve that a number, a list of keys or an object with keys stands for.

    Raises:
        DocumentError: none of these; names the place.
    """
    if isinstance(value, int | float):
        return constant(as_number(value, place))
    if not isinstance(value, list | dict):
        raise_unexpected(place, "a number, a list of keys or an object", value)
    if isinstance(value, list):
        value = {"keys": value}
    data = as_object(value, place, ("interpolation", "keys"))
    default = _interpolation(data, place, "cubic")
    keys = as_list(need(data, "keys", place), f"{place}.keys")
    if not keys:
        raise DocumentError(f"{place}.keys", "expected at least one key, found none")
    rows: list[tuple[float, float, str, float, float]] = []
    for index, key in enumerate(keys):
        where = f"{place}.keys[{index}]"
        row = _key(key, where, default)
        if rows and row[0] - rows[-1][0] < MIN_STEP:
            before = f"{rows[-1][0]:g} s of the key before"
            raise DocumentError(
                f"{where}.time", f"expected a time after the {before}, found {row[0]:g} s"
            )
        rows.append(row)
    times, values, kinds, *slopes = zip(*rows, strict=True)
    return Curve(np.array(times), np.array(values), kinds, np.array(slopes[0]), np.array(slopes[1]))


def _key(key: object, place: str, default: str) -> tuple[float, float, str, float, float]:
    if isinstance(key, list):
        if len(key) != 2:
            raise DocumentError(place, f"expected [time, value], found {len(key)} entries")
        key = {"time": key[0], "value": key[1]}
    data = as_object(key, place, _KEY)
    return (
        as_number(need(data, "time", place), f"{place}.time"),
        as_number(need(data, "value", place), f"{place}.value"),
        _interpolation(data, place, default),
        as_number(data["in"], f"{place}.in") if "in" in data else math.nan,
        as_number(data["out"], f"{place}.out") if "out" in data else math.nan,
    )


def _interpolation(data: dict[str, Any], place: str, default: str) -> str:
    where = f"{place}.interpolation"
    return as_choice(data.get("interpolation", default), where, "interpolation", INTERPOLATIONS)


def curve_to_json(curve: Curve) -> Any:
    """The shortest of the three forms that holds all of the curve."""
    assert curve.slopes_in is not None
    assert curve.slopes_out is not None
    default = Counter(curve.interpolation).most_common(1)[0][0]
    keys: list[Any] = []
    rows = zip(curve.times, curve.values, curve.interpolation, strict=True)
    for (time, value, kind), *slopes in zip(rows, curve.slopes_in, curve.slopes_out, strict=True):
        named = {"in": slopes[0], "out": slopes[1]}
        extra: dict[str, Any] = {} if kind == default else {"interpolation": kind}
        extra |= {name: rounded(slope) for name, slope in named.items() if not math.isnan(slope)}
        pair = [rounded(time), rounded(value)]
        keys.append({"time": pair[0], "value": pair[1], **extra} if extra else pair)
    if len(keys) == 1 and keys[0] == [0.0, rounded(curve.values[0])] and default == "cubic":
        return keys[0][1]
    return {"keys": keys} if default == "cubic" else {"interpolation": default, "keys": keys}


def rounded(number: float) -> float:
    """The number to twelve digits, so that degrees come back from radians as they were."""
    return float(f"{number:.12g}")
