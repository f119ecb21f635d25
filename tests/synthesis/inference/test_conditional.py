"""The closed form that motion propagation is compared with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mien.errors import InputError
from mien.synthesis.inference.conditional import ConditionalGaussian
from mien.synthesis.inference.propagation import MotionPropagation
from moving import LAYOUT, POINTS, expressions

KNOWN = np.array([0, 3, 6, 9, 11, 14, 17, 20, 22])


def test_an_expression_in_the_subspace_is_found_from_some_points(rng):
    statistics = expressions(rng)
    motion = ConditionalGaussian(statistics, components=4, min_noise=1e-6)
    found = motion.infer(KNOWN, statistics[3, KNOWN])
    np.testing.assert_allclose(found.displacements, statistics[3], atol=1e-6)
    assert found.iterations == 1


def test_all_points_known_reproduce_themselves(rng):
    statistics = expressions(rng)
    found = ConditionalGaussian(statistics).infer(np.arange(POINTS), statistics[3])
    np.testing.assert_allclose(found.displacements, statistics[3], atol=0.01)


def test_is_the_conditional_mean_of_the_normal_distribution(rng):
    statistics = expressions(rng, 6, noise=1.0)
    motion = ConditionalGaussian(statistics, components=5)
    given = statistics[0, KNOWN] + rng.normal(size=(len(KNOWN), 2))
    flat = statistics.reshape(len(statistics), -1)
    values, vectors = np.linalg.eigh(np.cov(flat.T))
    noise = values[:-5].mean()
    vectors = vectors[:, -5:] * np.sqrt(values[-5:])
    mean, covariance = flat.mean(axis=0), vectors @ vectors.T
    rows = np.stack([2 * KNOWN, 2 * KNOWN + 1], axis=1).ravel()
    known = covariance[np.ix_(rows, rows)] + noise * np.eye(len(rows))
    expected = mean + covariance[:, rows] @ np.linalg.solve(known, given.ravel() - mean[rows])
    np.testing.assert_allclose(motion.infer(KNOWN, given).displacements.ravel(), expected)


def test_the_mean_given_the_mean_is_the_mean(rng):
    statistics = expressions(rng, noise=1.0)
    mean = statistics.mean(axis=0)
    found = ConditionalGaussian(statistics).infer(KNOWN, mean[KNOWN])
    np.testing.assert_allclose(found.displacements, mean, atol=1e-9)


@pytest.mark.parametrize(
    "model", [ConditionalGaussian, lambda rows: MotionPropagation(LAYOUT, rows)]
)
def test_statistics_without_motion_give_the_face_at_rest(model, rng):
    rest = np.tile(rng.normal(size=(POINTS, 2)), (3, 1, 1))
    found = model(rest).infer(KNOWN, rest[0, KNOWN] + 2)
    np.testing.assert_allclose(found.displacements, rest[0], atol=1e-9)


def test_propagation_in_one_set_with_prior_comes_to_the_same(rng):
    statistics = expressions(rng, 6, noise=1.0)
    given = statistics[0, KNOWN] + rng.normal(size=(len(KNOWN), 2))
    one = SimpleNamespace(sets=LAYOUT.sets[:1])
    patient = {"threshold": 1e-9, "max_iterations": 3000}
    expected = ConditionalGaussian(statistics, components=5).infer(KNOWN, given)
    for weight in (0.0, 10.0):
        propagation = MotionPropagation(
            one, statistics, components=5, known_weight=weight, prior_weight=1, **patient
        )
        found = propagation.infer(KNOWN, given)
        np.testing.assert_allclose(found.displacements, expected.displacements, atol=1e-5)
        np.testing.assert_allclose(found.errors[-1], expected.errors[0], atol=1e-5)


def test_the_order_of_the_known_points_does_not_matter(rng):
    statistics = expressions(rng, noise=0.5)
    order = rng.permutation(len(KNOWN))
    motion, given = ConditionalGaussian(statistics), statistics[0, KNOWN]
    np.testing.assert_array_equal(
        motion.infer(KNOWN[order], given[order]).displacements,
        motion.infer(KNOWN, given).displacements,
    )


def test_bad_input_is_named(rng):
    motion = ConditionalGaussian(expressions(rng))
    with pytest.raises(InputError, match="known: expected points from 0 to 23, got 24"):
        motion.infer([24], np.zeros((1, 2)))
    with pytest.raises(InputError, match="displacements: expected finite numbers"):
        motion.infer([2], [[np.nan, 0]])
    with pytest.raises(InputError, match="statistics: expected 2 expressions or more"):
        ConditionalGaussian(np.zeros((1, 5, 2)))
    with pytest.raises(InputError, match="statistics: expected at least one point"):
        ConditionalGaussian(np.zeros((3, 0, 2)))
    with pytest.raises(InputError, match="min_noise: expected a number above zero"):
        ConditionalGaussian(expressions(rng), min_noise=0)
    with pytest.raises(InputError, match="components: expected a number from 1 on"):
        ConditionalGaussian(expressions(rng), components=0)
