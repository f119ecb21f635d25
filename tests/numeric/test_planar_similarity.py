"""Similarities in the plane, against known ones and nudged ones."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.numeric.planar_similarity import PlanarSimilarity, estimate_planar_similarity

TRUE = PlanarSimilarity(np.array(1.1), np.array(-0.3), np.array([40.0, -12.0]))


@pytest.fixture
def neutral(rng):
    return 300 + 80 * rng.normal(size=(20, 2))


def test_recovers_a_known_motion(neutral):
    found = estimate_planar_similarity(neutral, TRUE(neutral))
    assert (found.a, found.b) == (pytest.approx(1.1), pytest.approx(-0.3))
    np.testing.assert_allclose(found.translation, TRUE.translation)
    assert found.scale == pytest.approx(np.hypot(1.1, 0.3))


def test_the_inverse_inverts(rng, neutral):
    points = rng.normal(size=(20, 2))
    np.testing.assert_allclose(TRUE.inverse(TRUE(points)), points, atol=1e-12)


def test_any_other_motion_is_further_off(rng, neutral):
    target = TRUE(neutral) + rng.normal(size=neutral.shape)
    found = estimate_planar_similarity(neutral, target)
    best = np.sum((found(neutral) - target) ** 2)
    for nudge in 1e-3 * np.concatenate([np.eye(4), -np.eye(4)]):
        moved = PlanarSimilarity(
            found.a + nudge[0], found.b + nudge[1], found.translation + nudge[2:]
        )
        assert np.sum((moved(neutral) - target) ** 2) > best


def test_a_motion_turns_and_shifts_as_defined():
    """From x to y, twice as large."""
    turn = PlanarSimilarity(np.array(0.0), np.array(2.0), np.array([5.0, 1.0]))
    np.testing.assert_allclose(turn(np.array([[1.0, 0.0], [0.0, 1.0]])), [[5, 3], [3, 1]])


def test_coinciding_points_are_refused(neutral):
    with pytest.raises(EstimationError, match="those at rest share a place"):
        estimate_planar_similarity(np.full((20, 2), 7.0), neutral)
    with pytest.raises(EstimationError, match="those that moved share a place"):
        estimate_planar_similarity(neutral, np.full((20, 2), 7.0))


def test_bad_input_is_named(neutral):
    with pytest.raises(InputError, match="source: expected at least 2 points, got 1"):
        estimate_planar_similarity(neutral[:1], neutral[:1])
    with pytest.raises(InputError, match="target: expected shape"):
        estimate_planar_similarity(neutral, neutral[:5])
    with pytest.raises(InputError, match="source: expected finite numbers"):
        estimate_planar_similarity(np.full((5, 2), np.nan), neutral[:5])
