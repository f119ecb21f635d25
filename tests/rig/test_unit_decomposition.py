from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.rig.unit_decomposition import UnitDecomposition

RIDGE = 0.05
LEFT, RIGHT, BOTH, NOWHERE = range(4)
"""Units: of the left, of the right, of both, and one that no expression has."""


def units() -> Array:
    """(4, 40, 3) mm."""
    moved = np.zeros((4, 40, 3))
    moved[LEFT, :10, 0] = 2
    moved[RIGHT, 10:20, 1] = 1
    moved[BOTH, :20, 2] = 1
    moved[NOWHERE, 5:15, 1] = 3
    return moved


MASKS = np.zeros((40, 2))
MASKS[:10, 0] = MASKS[10:20, 1] = 1
WEIGHTS = np.array([[0, 0, 0, 0], [0.8, 0, 0.5, 0], [0, 0.9, 0, 0], [0.6, 0.7, 0.2, 0]])


def offsets() -> Array:
    """(4, 40, 3) mm: what the units say, and a little of everything."""
    rest = np.random.default_rng(3).normal(size=(4, 40, 3))
    rest[0] = 0
    return np.tensordot(WEIGHTS, units(), axes=1) + rest


KNOWN = UnitDecomposition.of(WEIGHTS, units(), offsets(), MASKS)


def cost(region: int, asked: Array, shares: Array) -> float:
    """How far the shares' units are from those asked for, and how much comes along."""
    known = KNOWN.by_region[region, 1:]
    wanted = asked * (known != 0).any(axis=0)
    return float(((shares @ known - wanted) ** 2).sum() + RIDGE**2 * (shares**2).sum())


def test_residuals_are_what_the_units_do_not_explain() -> None:
    rebuilt = np.tensordot(WEIGHTS, units(), axes=1) + KNOWN.residuals
    np.testing.assert_allclose(rebuilt[1:], offsets()[1:], atol=1e-12)
    assert not KNOWN.residuals[0].any()


def test_units_belong_to_the_regions_that_they_move_and_the_rest() -> None:
    left, right, rest = KNOWN.by_region
    np.testing.assert_array_equal(left, WEIGHTS * [1, 0, 1, 1])
    np.testing.assert_array_equal(right, WEIGHTS * [0, 1, 1, 1])
    np.testing.assert_array_equal(rest, WEIGHTS)


@pytest.mark.parametrize("seed", range(6))
def test_the_weights_are_the_optimum(seed: int) -> None:
    """No feasible nudge is better: one more or less, one for another, or any."""
    rng = np.random.default_rng(seed)
    asked = rng.uniform(-0.3, 1.2, 4)
    for region, shares in enumerate(KNOWN.expression_weights(asked)):
        assert (shares >= 0).all()
        assert shares.sum() <= 1 + 1e-3
        best = cost(region, asked, shares)
        nudges = [*np.eye(3), *-np.eye(3), *rng.normal(size=(20, 3))]
        nudges += [a - b for a in np.eye(3) for b in np.eye(3)]
        for nudge in nudges:
            other = np.maximum(shares + 0.02 * nudge, 0)
            other /= max(other.sum(), 1.0)
            used = (KNOWN.by_region[region, 1:] != 0).any(axis=1)
            assert cost(region, asked, other * used) >= best - 1e-4


def test_zero_units_give_zero_weights() -> None:
    np.testing.assert_array_equal(KNOWN.expression_weights(np.zeros(4)), np.zeros((3, 3)))


@pytest.mark.parametrize("weight", [-1.0, 0.3, 1.0])
def test_a_unit_that_no_expression_has_gives_zero_weights(weight: float) -> None:
    np.testing.assert_array_equal(
        KNOWN.expression_weights(weight * np.eye(4)[NOWHERE]), np.zeros((3, 3))
    )
    asked = np.array([0.5, 0.2, 0.1, 0.0])
    with_it = KNOWN.expression_weights(asked + weight * np.eye(4)[NOWHERE])
    np.testing.assert_allclose(with_it, KNOWN.expression_weights(asked), atol=1e-9)


def test_the_opposite_of_an_expression_gives_zero_weights() -> None:
    assert KNOWN.expression_weights(-WEIGHTS[1]).max() < 1e-6


@pytest.mark.parametrize("expression", [1, 2])
def test_the_units_of_an_expression_give_its_weight(expression: int) -> None:
    """In the rest of the head, which all units concern; a sparing share is missing."""
    rest = KNOWN.expression_weights(WEIGHTS[expression])[2]
    np.testing.assert_allclose(rest, np.eye(3)[expression - 1], atol=0.02)
    half = KNOWN.expression_weights(0.5 * WEIGHTS[expression])[2]
    np.testing.assert_allclose(half, 0.5 * np.eye(3)[expression - 1], atol=0.02)


def test_weights_sum_to_at_most_one() -> None:
    for shares in KNOWN.expression_weights(3 * WEIGHTS[3]):
        assert shares.sum() == pytest.approx(1, abs=1e-3)


def test_each_side_has_its_own_weights() -> None:
    shares = KNOWN.expression_weights(np.array([0.0, 0.9, 0.0, 0.0]))
    assert not shares[0].any()
    assert shares[1].max() > 0.9


def test_neutral_alone_has_no_weights() -> None:
    alone = UnitDecomposition.of(WEIGHTS[:1], units(), offsets()[:1] * 0, MASKS)
    assert alone.expression_weights(np.ones(4)).shape == (3, 0)
