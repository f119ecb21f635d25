"""Procedural motion: blinking and breathing, reproducible by seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mien.animate.curves import MIN_STEP, Curve
from mien.arrays import Array, check_array
from mien.errors import InputError

MIN_PERIOD = 0.1
"""Seconds; limits the number of keys."""


@dataclass(frozen=True)
class Blink:
    """Both eyes blink at random intervals.

    Attributes:
        period: seconds from one blink to the next, on average.
        jitter: share of the period by which each blink comes earlier or later, 0 to 0.9.
        closing: seconds that the lids take to close.
        closed: seconds that they stay closed.
        opening: seconds that they take to open.
        amount: weight of the blink units; 1 closes the eyes.
        seed: of the random times.

    Raises:
        InputError: a duration of 0 or less, blinks that would overlap, a jitter out of range.
    """

    period: float = 4.0
    jitter: float = 0.4
    closing: float = 0.07
    closed: float = 0.04
    opening: float = 0.16
    amount: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        _check_period(self.period)
        for name in ("closing", "closed", "opening"):
            if not getattr(self, name) >= MIN_STEP:
                raise InputError(name, f"at least {MIN_STEP:g} s", getattr(self, name))
        check_array("amount", self.amount, ())
        _check_share("jitter", self.jitter)
        length = self.closing + self.closed + self.opening
        if length >= (shortest := self.period * (1 - self.jitter)):
            expected = f"blinks shorter than the pause between them ({shortest:g} s at least)"
            raise InputError("period", expected, f"blinks of {length:g} s")

    def channels(self, duration: float) -> Mapping[str, Curve]:
        """Curves for the lids of both eyes over this many seconds."""
        rng = np.random.default_rng(self.seed)
        # The first comes within the first period, so that a short clip blinks too.
        starts = self.period * rng.uniform(0.2, 0.8) + _events(
            rng, duration, self.period, self.jitter
        )
        steps = np.cumsum([0.0, self.closing, self.closed, self.opening])
        times = (starts[:, None] + steps).ravel()
        values = np.tile([0.0, self.amount, self.amount, 0.0], len(starts))
        curve = Curve(times, values)
        return {"units.eyeBlinkLeft": curve, "units.eyeBlinkRight": curve}


@dataclass(frozen=True)
class Breathing:
    """Small motion of the head with the breath, and slow sway.

    Attributes:
        period: seconds a breath.
        jitter: share by which breaths differ in length.
        rise: mm that the head is lifted by breathing in.
        tip: radians that it is tilted back.
        sway: radians of yaw and roll, slower than the breath.
        seed: of the random motion.

    Raises:
        InputError: a period below MIN_PERIOD, a jitter out of range, NaN.
    """

    period: float = 4.2
    jitter: float = 0.15
    rise: float = 1.2
    tip: float = float(np.radians(0.35))
    sway: float = float(np.radians(0.6))
    seed: int = 0

    def __post_init__(self) -> None:
        _check_period(self.period)
        _check_share("jitter", self.jitter)
        check_array("rise, tip and sway", (self.rise, self.tip, self.sway), (3,))

    def channels(self, duration: float) -> Mapping[str, Curve]:
        """Curves for the head's height, pitch, yaw and roll over this many seconds."""
        rng = np.random.default_rng(self.seed)
        starts = _events(rng, duration, self.period, self.jitter)
        # In less than two fifths of a breath the air comes in; it goes out more slowly.
        times = (starts[:, None] + [0.0, 0.4 * self.period * (1 - self.jitter)]).ravel()
        depths = rng.uniform(0.8, 1.0, len(starts))
        full = np.column_stack([np.zeros(len(starts)), depths]).ravel()
        lag = 0.12 * self.period
        drift_times = _events(rng, duration, 1.6 * self.period, 0.5)
        yaw, roll = self.sway * rng.uniform(-1, 1, (2, len(drift_times)))
        return {
            "head.y": Curve(times, self.rise * full),
            "head.pitch": Curve(times + lag, -self.tip * full),
            "head.yaw": Curve(drift_times, yaw),
            "head.roll": Curve(drift_times, 0.5 * roll),
        }


Generator = Blink | Breathing
GENERATORS: Mapping[str, type[Blink] | type[Breathing]] = {"blink": Blink, "breathing": Breathing}


def _events(rng: np.random.Generator, duration: float, period: float, jitter: float) -> Array:
    """(E,) rising times from 0 until past the duration, at least two."""
    count = int(duration / (period * (1 - jitter))) + 3
    gaps = period * (1 + jitter * rng.uniform(-1, 1, count))
    starts: Array = np.append(0.0, np.cumsum(gaps))
    return starts[: max(2, int(np.searchsorted(starts, duration)) + 1)]


def _check_period(period: float) -> None:
    if not MIN_PERIOD <= period < np.inf:
        raise InputError("period", f"a number of seconds from {MIN_PERIOD:g} up", period)


def _check_share(name: str, share: float) -> None:
    if not 0 <= share <= 0.9:
        raise InputError(name, "a share from 0 to 0.9", share)
