"""Curves: they meet their keys, follow Hermite's polynomial and never overshoot by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.curves import Curve, constant, sampled
from mien.errors import InputError


def test_given_tangents_make_the_hermite_polynomial() -> None:
    curve = Curve([1.0, 3.0], [2.0, -1.0], slopes_out=[0.7, 0.0], slopes_in=[0.0, -2.5])
    # The cubic p(t) with p(1) = 2, p'(1) = 0.7, p(3) = -1, p'(3) = -2.5, solved for directly.
    rows = [[1, 1, 1, 1], [0, 1, 2, 3], [1, 3, 9, 27], [0, 1, 6, 27]]
    coefficients = np.linalg.solve(np.array(rows, float), [2.0, 0.7, -1.0, -2.5])
    times = np.linspace(1, 3, 41)
    np.testing.assert_allclose(curve.at(times), np.polyval(coefficients[::-1], times), atol=1e-12)


@pytest.mark.parametrize("kind", ["cubic", "linear", "hold"])
def test_curves_meet_their_keys_and_stay_outside_of_them(
    kind: str, rng: np.random.Generator
) -> None:
    times, values = np.cumsum(rng.uniform(0.1, 1, 9)), rng.normal(size=9)
    curve = Curve(times, values, (kind,) * 9)
    np.testing.assert_array_equal(curve.at(times), values)
    np.testing.assert_array_equal(curve.at([times[0] - 5, times[-1] + 5]), values[[0, -1]])


def test_automatic_tangents_never_overshoot(rng: np.random.Generator) -> None:
    for _ in range(50):
        times, values = np.cumsum(rng.uniform(0.02, 2, 8)), rng.normal(size=8).round(1)
        curve = Curve(times, values)
        for start in range(7):
            inside = curve.at(np.linspace(times[start], times[start + 1], 50))
            steps = np.diff(inside) * np.sign(values[start + 1] - values[start])
            assert steps.min() >= -1e-12, "between two keys the curve only goes one way"


def test_automatic_tangents_are_smooth_and_flat_at_the_ends() -> None:
    curve = Curve([0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 3.0, 4.0])
    step = 1e-6
    for key in (1.0, 2.0):
        before, at, after = curve.at([key - step, key, key + step])
        assert (at - before) / step == pytest.approx((after - at) / step, abs=1e-4)
        assert after > at
    np.testing.assert_array_equal(curve.slopes[:, [0, -1]], 0.0)


def test_hold_keeps_its_value_until_the_next_key_whose_own_counts_from_its_time() -> None:
    curve = Curve([0.0, 1.0, 2.0], [5.0, 7.0, 9.0], ("hold", "linear", "cubic"))
    np.testing.assert_array_equal(curve.at([0, 0.5, 1 - 1e-12, 1, 1.5, 2]), [5, 5, 5, 7, 8, 9])


def test_scaling_scales_everywhere(rng: np.random.Generator) -> None:
    curve = Curve([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], slopes_out=[4.0, np.nan, np.nan])
    times = np.linspace(-1, 3, 50)
    np.testing.assert_allclose(curve.scaled(-2).at(times), -2 * curve.at(times), atol=1e-12)


def test_sampling_keeps_the_values() -> None:
    curve = Curve([0.0, 1.0, 2.0], [1.0, 3.0, 2.0])
    times = np.linspace(0, 2, 61)
    np.testing.assert_array_equal(sampled(times, curve.at(times)).at(times), curve.at(times))
    assert constant(0.3).at([-1, 7]).tolist() == [0.3, 0.3]
    assert sampled([0, 2], [0, 2]).at([1]).tolist() == [1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], []), "times: expected at least one key, got none"),
        (([0, 1, 1], [0, 0, 0]), r"times\[2\]: expected a time after 1 s, got 1 s"),
        (([0, np.nan], [0, 0]), "times: expected finite numbers"),
        (([0, 1], [0, np.inf]), "values: expected finite numbers"),
        (([0, 1], [0]), r"values: expected shape \(2\)"),
        (([0, 1], [0, 0], ("cubic", "bounce")), "interpolation: .* got 'bounce'"),
        (([0, 1], [0, 0], ("cubic",)), "interpolation: .* got 1 entries"),
    ],
)
def test_bad_keys_are_named(arguments: tuple, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Curve(*arguments)
