"""Blinking and breathing: deterministic, in range, really there."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.curves import Curve
from mien.animate.layers import Blink, Breathing
from mien.animate.timeline import Layer, Timeline
from mien.errors import InputError
from mien.limits import UNIT_RANGE

TIMES = np.arange(0, 60, 1 / 120)


@pytest.mark.parametrize("kind", [Blink, Breathing])
def test_the_same_seed_moves_alike_and_another_one_otherwise(kind: type) -> None:
    first, again, other = (kind(seed=seed).channels(60) for seed in (3, 3, 4))
    assert first.keys() == again.keys() == other.keys()
    for name, curve in first.items():
        np.testing.assert_array_equal(curve.at(TIMES), again[name].at(TIMES))
        assert np.abs(curve.at(TIMES) - other[name].at(TIMES)).max() > 0


def test_eyes_blink_as_often_and_as_long_as_asked() -> None:
    blink = Blink(period=3, jitter=0.3, closing=0.07, closed=0.05, opening=0.15, amount=0.9)
    left = blink.channels(60)["units.eyeBlinkLeft"].at(TIMES)
    right = blink.channels(60)["units.eyeBlinkRight"].at(TIMES)
    np.testing.assert_array_equal(left, right)
    assert left.min() == 0
    assert left.max() == pytest.approx(0.9)
    edges = np.flatnonzero(np.diff((left > 0).astype(int)))
    starts, ends = TIMES[edges[::2]], TIMES[edges[1::2]]
    assert 60 / 3.9 - 1 <= len(starts) <= 60 / 2.1 + 1
    np.testing.assert_allclose(ends - starts[: len(ends)], 0.27, atol=2 / 120)
    gaps = np.diff(starts)
    assert gaps.min() >= 2.1 - 0.01
    assert gaps.max() <= 3.9 + 0.01
    assert np.ptp(gaps) > 0.2, "a machine blinks to the beat"


def test_a_short_clip_blinks_too() -> None:
    for seed in range(20):
        assert Blink(seed=seed).channels(4)["units.eyeBlinkLeft"].at(TIMES[:480]).max() > 0.99


def test_breathing_is_small_slow_and_goes_on() -> None:
    breathing = Breathing(period=4, jitter=0.1, rise=1.0, tip=0.01, sway=0.02)
    curves = breathing.channels(60)
    height = curves["head.y"].at(TIMES)
    assert height.min() == 0
    assert 0.8 <= height.max() <= 1
    breaths = np.flatnonzero(np.diff((height > 0.5).astype(int)) == 1)
    assert 60 / 4.4 - 1 <= len(breaths) <= 60 / 3.6 + 1
    assert np.abs(curves["head.pitch"].at(TIMES)).max() <= 0.01
    assert np.abs(curves["head.yaw"].at(TIMES)).max() <= 0.02
    assert np.ptp(height[-1200:]) > 0.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Blink(period=0), "period: expected a number of seconds from 0.1 up"),
        (lambda: Blink(closed=0), "closed: expected at least 1e-06 s, got 0"),
        (lambda: Blink(jitter=1.5), "jitter: expected a share from 0 to 0.9, got 1.5"),
        (lambda: Blink(period=0.3), "period: expected blinks shorter than the pause"),
        (lambda: Breathing(period=-1), "period: expected a number of seconds from 0.1 up"),
        (lambda: Breathing(rise=float("nan")), "rise, tip and sway: expected finite numbers"),
    ],
)
def test_bad_parameters_are_named(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_a_blink_over_a_recorded_blink_closes_the_lids_once() -> None:
    """The sum stays where a face unit may be; lids that somebody drove further stay there."""
    shut, wide = (Curve(np.array([0.0, 8.0]), np.full(2, amount)) for amount in (1.0, 2.0))
    times = np.linspace(0, 8, 2000)
    layer = Layer(generator=Blink())
    for recorded, most in ((shut, UNIT_RANGE[1]), (wide, 2.0)):
        timeline = Timeline(8.0, tracks={"units.eyeBlinkLeft": recorded}, layers=(layer,))
        found = timeline.sample(times)
        assert found["units.eyeBlinkLeft"].max() == pytest.approx(most)
        assert found["units.eyeBlinkLeft"].min() == pytest.approx(recorded.values[0])
        assert found["units.eyeBlinkRight"].max() == pytest.approx(1, abs=0.05)
