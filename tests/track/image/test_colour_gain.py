"""Another camera's gain and bias."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.image.colour_gain import ColourGain, estimate_colour_gain
from mien.track.image.greyscale import LUMA

TRUE = ColourGain(np.array([1.2, 0.8, 0.95]), np.array([-12.0, 20.0, 3.0]))


@pytest.fixture
def drawn(rng: np.random.Generator) -> Array:
    """A picture of strong contrasts."""
    return np.float32(rng.uniform(20, 200, (60, 50, 3)))


def everywhere(picture: Array) -> Array:
    return np.ones(picture.shape[:2], np.float32)


def test_gain_and_bias_are_found(drawn: Array) -> None:
    found = estimate_colour_gain(drawn, TRUE.applied(drawn), everywhere(drawn))
    np.testing.assert_allclose(found.gain, TRUE.gain, atol=0.01)
    np.testing.assert_allclose(found.applied(drawn), TRUE.applied(drawn), atol=0.5)


def test_pixels_without_weight_do_not_count(drawn: Array) -> None:
    target, weights = TRUE.applied(drawn), everywhere(drawn)
    target[:20], weights[:20] = 0, 0
    found = estimate_colour_gain(drawn, target, weights)
    np.testing.assert_allclose(found.gain, TRUE.gain, atol=0.01)


def test_a_plain_face_is_only_brighter(drawn: Array, rng: np.random.Generator) -> None:
    plain = np.float32(120 + 0.3 * rng.normal(size=drawn.shape))
    noisy = np.float32(plain + 15 + 8 * rng.normal(size=drawn.shape))
    found = estimate_colour_gain(plain, noisy, everywhere(plain))
    np.testing.assert_allclose(found.gain, 1, atol=0.25)
    np.testing.assert_allclose(found.applied(plain).mean(axis=(0, 1)), 135, atol=1)


def test_nothing_seen_changes_nothing(drawn: Array) -> None:
    found = estimate_colour_gain(drawn, TRUE.applied(drawn), 0 * everywhere(drawn))
    np.testing.assert_array_equal(found.gain, 1)
    np.testing.assert_array_equal(found.bias, 0)


def test_luma_before_is_that_of_the_drawn_picture(drawn: Array) -> None:
    found = TRUE.corrected_luma(TRUE.applied(drawn))
    np.testing.assert_allclose(found, drawn @ np.array(LUMA), atol=1e-2)


def test_towards() -> None:
    half = ColourGain().towards(TRUE, 0.5)
    np.testing.assert_allclose(half.gain, [1.1, 0.9, 0.975])
    np.testing.assert_allclose(half.bias, [-6, 10, 1.5])
