"""Curves over time through keys, with cubic, linear or constant interpolation."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.errors import InputError

Interpolation = Literal["cubic", "linear", "hold"]
MIN_STEP = 1e-6
"""Least seconds between two keys: slopes over a shorter step could overflow."""

INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)
_CUBIC, _LINEAR, _ = range(len(INTERPOLATIONS))


@dataclass(frozen=True)
class Curve:
    """A scalar over time, constant before the first key and after the last one.

    Attributes:
        times: (K,) seconds, K >= 1, rising.
        values: (K,) at those times.
        interpolation: from each key to the next: "cubic", "linear" or "hold"
            (constant until the next key).
        slopes_in: (K,) derivative of a cubic before the key, per second; NaN: automatic.
        slopes_out: (K,) derivative after the key.
        slopes: (2, K) both, with the automatic ones filled in; computed, not given.

    Raises:
        InputError: no key, a time that does not rise, NaN, an unknown interpolation.
    """

    times: Float[Array, " k"]
    values: Float[Array, " k"]
    interpolation: tuple[str, ...] = ()
    slopes_in: Float[Array, " k"] | None = None
    slopes_out: Float[Array, " k"] | None = None
    slopes: Float[Array, "2 k"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        times = check_array("times", self.times, (None,))
        count = len(times)
        if not count:
            raise InputError("times", "at least one key", "none")
        if (falls := np.flatnonzero(np.diff(times) < MIN_STEP)).size:
            index = int(falls[0]) + 1
            expected = f"a time after {times[index - 1]:g} s"
            raise InputError(f"times[{index}]", expected, f"{times[index]:g} s")
        kinds = tuple(self.interpolation) or ("cubic",) * count
        if len(kinds) != count or (unknown := set(kinds) - set(INTERPOLATIONS)):
            found = f"{len(kinds)} entries" if len(kinds) != count else f"{unknown.pop()!r}"
            raise InputError("interpolation", f"{count} of {', '.join(INTERPOLATIONS)}", found)
        values = check_array("values", self.values, (count,))
        given = [_check_slopes(self.slopes_in, count), _check_slopes(self.slopes_out, count)]
        resolved: Array = np.broadcast_to(0.0, (2, count))
        if "cubic" in kinds:
            automatic = _auto_slopes(times, values, np.array(kinds) == "hold")
            resolved = np.array([np.where(np.isnan(slope), automatic, slope) for slope in given])
        for name, array in (
            ("times", times),
            ("values", values),
            ("slopes_in", given[0]),
            ("slopes_out", given[1]),
            ("slopes", resolved),
        ):
            object.__setattr__(self, name, frozen(array))
        object.__setattr__(self, "interpolation", kinds)

    def at(self, times: Float[Array, " n"]) -> Float[Array, " n"]:
        """(N,) values at these times in seconds, exact at keys."""
        times = np.asarray(times, dtype=np.float64)
        start = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, None)
        end = np.minimum(start + 1, len(self.times) - 1)
        span = np.where(end > start, self.times[end] - self.times[start], 1.0)
        phase = np.clip((times - self.times[start]) / span, 0.0, 1.0)
        phase = np.where(end > start, phase, 0.0)
        kind = self._kinds[start]
        a, b = self.values[start], self.values[end]
        cubic = _hermite(phase, a, b, self.slopes[1, start] * span, self.slopes[0, end] * span)
        straight = a + phase * (b - a)
        return np.select([kind == _CUBIC, kind == _LINEAR], [cubic, straight], a)

    @cached_property
    def _kinds(self) -> Int[Array, " k"]:
        """Indices into INTERPOLATIONS."""
        return np.array([INTERPOLATIONS.index(kind) for kind in self.interpolation], np.int8)

    def scaled(self, factor: float) -> Curve:
        """The curve with its values and slopes multiplied."""
        return Curve(
            self.times,
            self.values * factor,
            self.interpolation,
            _given(self.slopes_in) * factor,
            _given(self.slopes_out) * factor,
        )


def constant(value: float) -> Curve:
    """The same value at all times."""
    return Curve(np.zeros(1), np.array([value]))


def sampled(times: Float[Array, " n"], values: Float[Array, " n"]) -> Curve:
    """A curve through these values, with linear interpolation."""
    return Curve(times, values, ("linear",) * len(times))


def _hermite(u: Array, a: Array, b: Array, leaving: Array, arriving: Array) -> Array:
    """Cubic Hermite polynomial over u in [0, 1]; its slopes are per unit of u."""
    v = 1 - u
    return (
        (1 + 2 * u) * v * v * a
        + u * v * v * leaving
        + u * u * (3 - 2 * u) * b
        - u * u * v * arriving
    )


def _auto_slopes(times: Array, values: Array, holds: Array) -> Array:
    """Slopes that never overshoot: flat at the ends, at extremes and beside a held value.

    Between two rises the weighted harmonic mean of their steepnesses, which is at most three times
    the smaller one and so keeps every piece monotone.

    Source:
        Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984, eq. (5).
    """
    slopes = np.zeros(len(times))
    if len(times) < 3:
        return slopes
    spans = np.diff(times)
    steep = np.where(holds[:-1], 0.0, np.diff(values) / spans)
    before, after = steep[:-1], steep[1:]
    product = before * after
    near, far = 2 * spans[1:] + spans[:-1], spans[1:] + 2 * spans[:-1]
    weighted = np.where(product > 0, near * after + far * before, 1.0)
    slopes[1:-1] = np.where(product > 0, (near + far) * product / weighted, 0.0)
    return slopes


def _check_slopes(slopes: Array | None, count: int) -> Array:
    given = np.broadcast_to(np.nan, count) if slopes is None else slopes
    return check_array("slopes", given, (count,), finite=False)


def _given(slopes: Array | None) -> Array:
    assert slopes is not None
    return slopes
