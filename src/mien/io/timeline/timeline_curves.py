"""Curves in timeline documents: a number, a list of keys, or keys and their interpolation."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from mien.animate.curves import INTERPOLATIONS, MIN_STEP, Curve, constant
from mien.errors import DocumentError
from mien.reading.strict_json import JsonValue

_KEY = ("time", "value", "interpolation", "in", "out")


def curve_from_json(value: JsonValue) -> Curve:
    """The curve that a number, a list of keys or an object with keys stands for.

    Raises:
        DocumentError: none of these; names the place.
    """
    if isinstance(value.raw, int | float):
        return constant(value.number())
    if not isinstance(value.raw, list | dict):
        raise value.unexpected("a number, a list of keys or an object")
    if isinstance(value.raw, list):
        value = replace(value, raw={"keys": value.raw})
    value.members(("interpolation", "keys"))
    default = _interpolation(value, "cubic")
    keys = value["keys"].items()
    if not keys:
        raise value["keys"].error("expected at least one key, found none")
    rows: list[tuple[float, float, str, float, float]] = []
    for key in keys:
        row = _key(key, default)
        if rows and row[0] - rows[-1][0] < MIN_STEP:
            before = f"{rows[-1][0]:g} s of the key before"
            problem = f"expected a time after the {before}, found {row[0]:g} s"
            raise DocumentError(f"{key.place}.time", problem)
        rows.append(row)
    times, values, kinds, *slopes = zip(*rows, strict=True)
    return Curve(np.array(times), np.array(values), kinds, np.array(slopes[0]), np.array(slopes[1]))


def _key(key: JsonValue, default: str) -> tuple[float, float, str, float, float]:
    if isinstance(key.raw, list):
        if len(key.raw) != 2:
            raise key.error(f"expected [time, value], found {len(key.raw)} entries")
        key = replace(key, raw=dict(zip(("time", "value"), key.raw, strict=True)))
    key.members(_KEY)
    time, value, kind = key["time"].number(), key["value"].number(), _interpolation(key, default)
    before, after = (key[name].number() if name in key else math.nan for name in ("in", "out"))
    return time, value, kind, before, after


def _interpolation(data: JsonValue, default: str) -> str:
    return data.get("interpolation", default).choice("interpolation", INTERPOLATIONS)


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
