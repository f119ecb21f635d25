"""The residual process is smooth, and no larger than the given displacements need."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.synthesis.inference.conditional import MAX_RMS_DEVIATIONS, ConditionalGaussian
from mien.synthesis.inference.residual_process import matern32, smallest_variance


def line_of_points(count):
    """Points along a line one face width long."""
    return np.column_stack([np.linspace(0, 1, count), np.zeros(count)])


def test_the_correlation_falls_with_the_distance():
    correlation = matern32(line_of_points(30))
    np.testing.assert_allclose(np.diag(correlation), 1)
    np.testing.assert_allclose(correlation, correlation.T)
    assert (np.diff(correlation[0]) < 0).all()
    assert correlation[0, -1] < 0.01
    assert np.linalg.eigvalsh(correlation).min() > 0
    with pytest.raises(InputError, match="points: expected finite numbers"):
        matern32(np.array([[0, np.nan]]))


def test_the_variance_is_as_large_as_it_must_be(rng):
    mixed = rng.normal(size=(6, 6))
    covariance, correlation = mixed @ mixed.T + np.eye(6), matern32(rng.uniform(0, 1, (6, 2)))
    given = rng.normal(size=6) * 40
    variance, weights = smallest_variance(covariance, correlation, given, 1.5)
    total = covariance + variance * correlation
    np.testing.assert_allclose(total @ weights, given, rtol=1e-6)
    deviations = np.sqrt(given @ np.linalg.solve(total, given) / 6)
    assert deviations == pytest.approx(1.5, rel=1e-6)


def stiff(rng):
    """A line of points whose right half moves, 3 px, and whose left half hardly ever does."""
    template = line_of_points(40)
    modes = np.sin(np.outer([1, 2, 3], np.pi * template[:, 0]))[..., None] * [0.5, 1]
    modes[:, :20] *= 0.02
    statistics = np.tensordot(rng.normal(0, 3, (80, 3)), modes, axes=1)
    return template, statistics


def test_displacements_like_the_statistics_need_no_process(rng):
    template, statistics = stiff(rng)
    known = np.array([3, 25, 33])
    plain = ConditionalGaussian(statistics).infer(known, statistics[4, known])
    with_process = ConditionalGaussian(statistics, template=template).infer(
        known, statistics[4, known]
    )
    np.testing.assert_array_equal(plain.displacements, with_process.displacements)


def test_an_unlikely_displacement_moves_its_neighbours_and_not_the_rest(rng):
    template, statistics = stiff(rng)
    known, given = np.array([8, 30]), np.array([[0.0, 9.0], [0.0, 0.0]])
    plain = ConditionalGaussian(statistics).infer(known, given).displacements[:, 1]
    smooth = (
        ConditionalGaussian(statistics, template=template).infer(known, given).displacements[:, 1]
    )
    assert abs(smooth[8] - 9) < 0.5
    assert 3 < smooth[6] < 9
    assert 3 < smooth[10] < 9
    assert np.abs(smooth[22:]).max() < 0.3 * np.abs(plain[22:]).max()
    assert np.abs(np.diff(smooth)).max() < 3


def test_the_process_begins_without_a_jump(rng):
    """Points that are dragged ever farther take the others with them without a jump."""
    template, statistics = stiff(rng)
    motion, known = ConditionalGaussian(statistics, template=template), np.array([8, 30])
    given = np.linspace(0, 3, 301)[:, None, None] * [[0, 1], [0, 0]]
    found = np.stack([motion.infer(known, one).displacements for one in given])
    plain = ConditionalGaussian(statistics)
    expected = np.stack([plain.infer(known, one).displacements for one in given])
    differs = (found != expected).any(axis=(1, 2))
    assert not differs[0]
    assert differs[-1]
    # No step is larger than those without the process, which are all alike.
    steps = np.abs(np.diff(found, axis=0)).max(axis=(1, 2))
    assert steps.max() < 1.01 * np.abs(np.diff(expected, axis=0)).max()


def test_bad_options(rng):
    template, statistics = stiff(rng)
    with pytest.raises(InputError, match="template: expected shape"):
        ConditionalGaussian(statistics, template=template[:5])
    with pytest.raises(InputError, match="max_deviations: expected a number above zero"):
        ConditionalGaussian(statistics, template=template, max_deviations=0)
    assert MAX_RMS_DEVIATIONS > 1
