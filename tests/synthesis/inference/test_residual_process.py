"""Bends are smooth, and no larger than what is given needs."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.synthesis.inference.conditional import MOST_DEVIATIONS, ConditionalMotion
from mien.synthesis.inference.residual_process import closeness, least_bend


def row_of_points(count):
    """Places along a line one face width long."""
    return np.column_stack([np.linspace(0, 1, count), np.zeros(count)])


def test_points_bend_together_the_nearer_the_more():
    near = closeness(row_of_points(30))
    np.testing.assert_allclose(np.diag(near), 1)
    np.testing.assert_allclose(near, near.T)
    assert (np.diff(near[0]) < 0).all()
    assert near[0, -1] < 0.01
    assert np.linalg.eigvalsh(near).min() > 0
    with pytest.raises(InputError, match="places: expected finite numbers"):
        closeness(np.array([[0, np.nan]]))


def test_a_bend_is_as_large_as_it_must_be(rng):
    mixed = rng.normal(size=(6, 6))
    usual, bend = mixed @ mixed.T + np.eye(6), closeness(rng.uniform(0, 1, (6, 2)))
    given = rng.normal(size=6) * 40
    variance, force = least_bend(usual, bend, given, 1.5)
    total = usual + variance * bend
    np.testing.assert_allclose(total @ force, given, rtol=1e-6)
    deviations = np.sqrt(given @ np.linalg.solve(total, given) / 6)
    assert deviations == pytest.approx(1.5, rel=1e-6)


def stiff(rng):
    """A line of points whose right half moves, 3 px, and whose left half hardly ever does."""
    places = row_of_points(40)
    ways = np.sin(np.outer([1, 2, 3], np.pi * places[:, 0]))[..., None] * [0.5, 1]
    ways[:, :20] *= 0.02
    seen = np.tensordot(rng.normal(0, 3, (80, 3)), ways, axes=1)
    return places, seen


def test_what_is_usual_bends_nothing(rng):
    places, seen = stiff(rng)
    known = np.array([3, 25, 33])
    plain = ConditionalMotion(seen).infer(known, seen[4, known])
    bending = ConditionalMotion(seen, places=places).infer(known, seen[4, known])
    np.testing.assert_array_equal(plain.displacements, bending.displacements)


def test_what_nobody_saw_moves_its_neighbours_and_not_the_rest(rng):
    places, seen = stiff(rng)
    known, given = np.array([8, 30]), np.array([[0.0, 9.0], [0.0, 0.0]])
    plain = ConditionalMotion(seen).infer(known, given).displacements[:, 1]
    bent = ConditionalMotion(seen, places=places).infer(known, given).displacements[:, 1]
    assert abs(bent[8] - 9) < 0.5
    assert 3 < bent[6] < 9
    assert 3 < bent[10] < 9
    assert np.abs(bent[22:]).max() < 0.3 * np.abs(plain[22:]).max()
    assert np.abs(np.diff(bent)).max() < 3


def test_bends_begin_where_the_usual_ends(rng):
    """Points that are dragged ever farther take the others with them without a jump."""
    places, seen = stiff(rng)
    motion, known = ConditionalMotion(seen, places=places), np.array([8, 30])
    given = np.linspace(0, 3, 301)[:, None, None] * [[0, 1], [0, 0]]
    found = np.stack([motion.infer(known, one).displacements for one in given])
    plain = ConditionalMotion(seen)
    expected = np.stack([plain.infer(known, one).displacements for one in given])
    bent = (found != expected).any(axis=(1, 2))
    assert not bent[0]
    assert bent[-1]
    # No step is larger than those without bends, which are all alike.
    steps = np.abs(np.diff(found, axis=0)).max(axis=(1, 2))
    assert steps.max() < 1.01 * np.abs(np.diff(expected, axis=0)).max()


def test_bad_options(rng):
    places, seen = stiff(rng)
    with pytest.raises(InputError, match="places: expected shape"):
        ConditionalMotion(seen, places=places[:5])
    with pytest.raises(InputError, match="most: expected a number above zero"):
        ConditionalMotion(seen, places=places, most=0)
    assert MOST_DEVIATIONS > 1
