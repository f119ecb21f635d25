"""Pixels that show something else than the face."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.photometric.photometric_error import (
    MIN_OUTLIER_SCALE,
    occlusion_weights,
    outlier_scale,
)

SHAPE = (120, 100)


@pytest.fixture
def image_pair(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Drawn; the frame, noisy by 5 grey levels, with a hand on a sixth of it; where that is."""
    drawn = np.float32(rng.uniform(60, 180, SHAPE))
    target = np.float32(drawn + 5 * rng.normal(size=SHAPE))
    hand = np.zeros(SHAPE, bool)
    hand[70:110, 20:70] = True
    target[hand] = 30
    return drawn, target, hand


def test_usual_difference_is_that_of_what_is_the_face(
    image_pair: tuple[Array, Array, Array],
) -> None:
    drawn, target, _ = image_pair
    found = outlier_scale(drawn, target, np.ones(SHAPE))
    assert 3 * 5 < found < 1.4 * 3 * 5


def test_a_perfect_picture_has_the_least(image_pair: tuple[Array, Array, Array]) -> None:
    drawn, _, _ = image_pair
    assert outlier_scale(drawn, drawn, np.ones(SHAPE)) == MIN_OUTLIER_SCALE
    assert outlier_scale(drawn, drawn, np.zeros(SHAPE)) == MIN_OUTLIER_SCALE


def test_what_covers_the_face_is_not_trusted(image_pair: tuple[Array, Array, Array]) -> None:
    drawn, target, hand = image_pair
    trust = occlusion_weights(drawn, target, np.ones(SHAPE, np.float32), face_px=100)
    assert trust.dtype == np.float32
    assert trust[hand].max() < 0.1
    away = np.ones(SHAPE, bool)
    away[64:116, 14:76] = False
    assert trust[away].min() > 0.7


def test_specks_are_trusted(image_pair: tuple[Array, Array, Array]) -> None:
    drawn, _, _ = image_pair
    target = drawn.copy()
    target[::23, ::23] += 15
    assert occlusion_weights(drawn, target, np.ones(SHAPE, np.float32), face_px=100).min() > 0.8


def test_unknown_pixels_are_not_judged(image_pair: tuple[Array, Array, Array]) -> None:
    drawn, target, hand = image_pair
    trust = occlusion_weights(drawn, target, np.float32(~hand), face_px=100)
    assert trust[hand].min() == 1
    np.testing.assert_array_equal(
        occlusion_weights(drawn, target, np.zeros(SHAPE, np.float32), face_px=100), 1
    )
