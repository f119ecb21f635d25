"""Head motion compensated ([Zhang 2006] sec. 12)."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.examples.head_alignment import align_to_neutral

TRUE = PlanarSimilarity(np.array(1.1), np.array(-0.3), np.array([40.0, -12.0]))


@pytest.fixture
def neutral(rng):
    return 300 + 80 * rng.normal(size=(20, 2))


def test_a_moved_neutral_face_is_the_neutral_face(neutral):
    geometry, _ = align_to_neutral(TRUE(neutral), neutral)
    np.testing.assert_allclose(geometry, neutral)


def test_expressions_that_no_motion_explains_stay(rng, neutral):
    centred = neutral - neutral.mean(axis=0)
    # What no translation, rotation or scale changes: orthogonal to all four.
    turned = centred[:, ::-1] * [-1, 1]
    rigid = [np.tile([1.0, 0], (20, 1)), np.tile([0, 1.0], (20, 1)), centred, turned]
    basis = np.linalg.qr(np.stack([part.ravel() for part in rigid], axis=1))[0]
    change = rng.normal(size=40)
    expression = neutral + (change - basis @ (basis.T @ change)).reshape(20, 2)
    geometry, _ = align_to_neutral(TRUE(expression), neutral)
    np.testing.assert_allclose(geometry, expression)


def test_a_batch_is_its_parts(rng, neutral):
    points = TRUE(neutral) + rng.normal(size=(3, 2, 20, 2))
    geometries, motion = align_to_neutral(points, neutral)
    assert geometries.shape == points.shape
    assert motion.a.shape == (3, 2)
    np.testing.assert_allclose(geometries[2, 1], align_to_neutral(points[2, 1], neutral)[0])
    np.testing.assert_allclose(motion(geometries), points)


def test_points_outside_of_the_subset_do_not_change_the_motion(rng, neutral):
    still = np.array([1, 4, 9])
    expression = neutral + rng.normal(size=neutral.shape)
    expression[still] = neutral[still]
    geometry, motion = align_to_neutral(TRUE(expression), neutral, subset=still)
    assert motion.a == pytest.approx(1.1)
    np.testing.assert_allclose(geometry, expression)


def test_two_points_suffice(neutral):
    geometry, _ = align_to_neutral(TRUE(neutral[:2]), neutral[:2])
    np.testing.assert_allclose(geometry, neutral[:2])


@pytest.mark.parametrize(
    ("points", "neutral", "message"),
    [
        (np.zeros((1, 2)), np.zeros((1, 2)), "source: expected at least 2 points, got 1"),
        (np.zeros((4, 2)), np.ones((5, 2)), "points: expected shape"),
        (np.full((5, 2), np.nan), np.ones((5, 2)), "points: expected finite numbers"),
        (np.ones((5, 2)), np.full((5, 2), np.inf), "neutral: expected finite numbers"),
    ],
)
def test_bad_input_is_named(points, neutral, message):
    with pytest.raises(InputError, match=message):
        align_to_neutral(points, neutral)


def test_points_in_one_place_determine_no_motion(neutral):
    with pytest.raises(EstimationError, match="those at rest share a place"):
        align_to_neutral(neutral, np.full((20, 2), 7.0))
    with pytest.raises(EstimationError, match="those that moved share a place"):
        align_to_neutral(np.full((20, 2), 7.0), neutral)
