"""The similarity between point sets."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.numeric.rotation import rotation_from_vector
from mien.numeric.similarity import Similarity, estimate_similarity

TRUE = Similarity(1.7, rotation_from_vector(np.array([0.3, -2.0, 1.1])), np.array([5.0, -3, 40]))


def test_recovers_a_known_similarity(rng):
    points = rng.normal(size=(10, 3))
    found = estimate_similarity(points, TRUE(points))
    assert found.scale == pytest.approx(1.7)
    np.testing.assert_allclose(found.rotation, TRUE.rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation, TRUE.translation)


def test_never_mirrors(rng):
    points = rng.normal(size=(10, 3))
    found = estimate_similarity(points, points * [1, 1, -1])
    assert np.linalg.det(found.rotation) == pytest.approx(1)


def test_points_on_a_plane_suffice(rng):
    points = rng.normal(size=(6, 3)) * [1, 1, 0]
    np.testing.assert_allclose(estimate_similarity(points, TRUE(points))(points), TRUE(points))


def test_weight_zero_drops_a_point(rng):
    points = rng.normal(size=(10, 3))
    target = TRUE(points)
    target[0] += 100
    weights = np.ones(10)
    weights[0] = 0
    assert estimate_similarity(points, target, weights).scale == pytest.approx(1.7)


def test_no_small_change_fits_better(rng):
    points = rng.normal(size=(10, 3))
    target = TRUE(points) + 0.1 * rng.normal(size=(10, 3))
    found = estimate_similarity(points, target)

    def cost(scale=1.0, turn=(0, 0, 0), shift=(0, 0, 0)):
        rotation = rotation_from_vector(np.array(turn, float)) @ found.rotation
        moved = Similarity(found.scale * scale, rotation, found.translation + shift)(points)
        return ((moved - target) ** 2).sum()

    for axis in np.eye(3):
        for step in (-1e-3, 1e-3):
            assert cost(scale=1 + step) > cost()
            assert cost(turn=step * axis) > cost()
            assert cost(shift=step * axis) > cost()


def test_refusals(rng):
    points = rng.normal(size=(5, 3))
    with pytest.raises(EstimationError, match="one line"):
        estimate_similarity(np.outer(np.arange(5), [1.0, 2, 3]), points)
    with pytest.raises(EstimationError, match="3 weighted points, there are 2"):
        estimate_similarity(points[:2], points[:2])
    with pytest.raises(InputError, match=r"target: expected shape \(5, 3\)"):
        estimate_similarity(points, points[:4])
    with pytest.raises(InputError, match="weights: expected numbers of 0 or more"):
        estimate_similarity(points, points, -np.ones(5))
