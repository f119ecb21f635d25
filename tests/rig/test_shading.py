from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC
from mien.arrays import Array
from mien.head import SHADING
from mien.rig.shading import (
    MAX_OPENING,
    OpeningMeter,
    Polynomial,
    brightness_at,
    fit_polynomial,
)
from posable import REST, explained_by

PARTS = ("eyes", "teeth")


def value(polynomial: Polynomial, openings: Array) -> Array:
    """c0 + c1 o + c2 o^2."""
    return np.polyval(polynomial[::-1], openings)


def openings_of(part: str, count: int) -> Array:
    return np.linspace(0.0, MAX_OPENING[part], count)


def known(part: str) -> Polynomial:
    """A person whose eyes and teeth lie in a deeper shadow than usual, as bright wide open."""
    wide = MAX_OPENING[part]
    c0, c1, c2 = SHADING[part]
    return c0 - 0.1, c1 + 0.1 / wide + 0.2, c2 - 0.2 / wide


def ratios(polynomial: Polynomial, openings: Array) -> list[tuple[float, float, float]]:
    """Every opening over the widest."""
    light = value(polynomial, openings)
    pairs = zip(openings, light / light[-1], strict=True)
    return [(float(at), float(openings[-1]), float(ratio)) for at, ratio in pairs][:-1]


@pytest.mark.parametrize("part", PARTS)
def test_the_wider_open_the_brighter(part: str) -> None:
    light = value(SHADING[part], openings_of(part, 30))
    assert (np.maximum.accumulate(light) - light).max() < 0.005
    assert 0.25 < light[0] < light[-1] < 1.5


def test_lids_at_rest_leave_eyes_as_they_are() -> None:
    assert value(SHADING["eyes"], np.array(1.0)) == pytest.approx(1)


@pytest.mark.parametrize("part", PARTS)
def test_without_pairs_of_photos_the_default_polynomial(part: str) -> None:
    np.testing.assert_allclose(fit_polynomial(part, []), SHADING[part], rtol=1e-9)


@pytest.mark.parametrize("part", PARTS)
def test_many_pairs_recover_the_persons_polynomial(part: str) -> None:
    openings = openings_of(part, 12)
    truth = value(known(part), openings)
    measured = ratios(known(part), openings) * 8
    errors = [
        np.abs(value(found, openings) - truth).max()
        for found in (fit_polynomial(part, measured), SHADING[part])
    ]
    assert errors[0] < 0.02
    assert errors[0] < errors[1] / 4


@pytest.mark.parametrize("part", PARTS)
def test_one_pair_of_photos_is_balanced_with_the_prior(part: str) -> None:
    first = ratios(known(part), openings_of(part, 12))[2]
    found = fit_polynomial(part, [first])
    ratio = [
        value(p, np.array(first[0])) / value(p, np.array(first[1])) for p in (SHADING[part], found)
    ]
    assert abs(ratio[1] - first[2]) < 0.8 * abs(ratio[0] - first[2])
    wide = np.array(MAX_OPENING[part])
    assert value(found, wide) == pytest.approx(value(SHADING[part], wide), abs=0.02)


@pytest.mark.parametrize("part", PARTS)
def test_ratios_of_the_default_keep_the_default(part: str) -> None:
    measured = ratios(SHADING[part], openings_of(part, 6))
    np.testing.assert_allclose(fit_polynomial(part, measured), SHADING[part], atol=1e-9)


def test_brightness_is_that_of_the_polynomials() -> None:
    openings = np.array([[1.0, 0.5, 0.1], [0.2, 1.2, 0.3]])
    light = brightness_at(openings, SHADING)
    np.testing.assert_allclose(light[:, :2], value(SHADING["eyes"], openings[:, :2]))
    np.testing.assert_allclose(light[:, 2], value(SHADING["teeth"], openings[:, 2]))
    np.testing.assert_array_equal(brightness_at(openings[0], SHADING), light[0])


def test_brightness_stays_where_nothing_was_measured() -> None:
    far = brightness_at(np.array([[5.0, 1.6, 3.0], [-1.0, 0.0, -1.0]]), SHADING)
    wide = brightness_at(np.array([1.6, 1.6, 0.4]), SHADING)
    closed = brightness_at(np.zeros(3), SHADING)
    np.testing.assert_array_equal(far, [wide, closed])


def test_brightness_has_bounds() -> None:
    dark = {"eyes": (-1.0, 0.0, 0.0), "teeth": (9.0, 0.0, 0.0)}
    np.testing.assert_allclose(brightness_at(np.ones(3), dark), [0.25, 0.25, 1.5])


def test_openings_are_ratios() -> None:
    """1 for lids at rest; lips apart over the mouth's width; no matter how large the head is."""
    openings = OpeningMeter.of(GENERIC, REST)
    rest = openings.measure(REST)
    np.testing.assert_allclose(rest[:2], 1)
    larger = OpeningMeter.of(GENERIC, 1.3 * REST)
    np.testing.assert_allclose(larger.measure(1.3 * REST), rest)
    open_wide = openings.measure(explained_by({"jawOpen": 1.0}))
    np.testing.assert_allclose(open_wide[:2], 1, atol=0.05)
    assert 0.3 < open_wide[2] < 1.5


def test_each_eye_has_an_opening_of_its_own() -> None:
    openings = OpeningMeter.of(GENERIC, REST)
    left, right, mouth = openings.measure(explained_by({"eyeBlinkLeft": 0.7}))
    assert left < 0.6
    assert right == pytest.approx(1, abs=0.01)
    assert mouth == pytest.approx(openings.measure(REST)[2], abs=0.01)
