"""The nearest mixture, against a second solver and where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from mien.errors import EstimationError, InputError
from mien.numeric.solvers.simplex import simplex_least_squares


def by_active_set(columns, target, slack=0.0, penalty=None):
    """Lawson and Hanson's method, polished on its active set by the optimum's linear equations."""
    count = columns.shape[1]
    residuals = columns - target[:, None]
    rows = np.vstack([residuals, 1e4 * np.ones(count)])
    right = np.append(residuals.sum(1) * slack, 1e4 * (1 + count * slack))
    free = nnls(rows, right, maxiter=1000)[0]
    chosen = np.flatnonzero(free > 1e-7)
    bound = np.full(count, -slack)
    bound[chosen] = 0
    size = len(chosen)
    system = np.zeros((size + 1, size + 1))
    system[:size, :size] = 2 * residuals[:, chosen].T @ residuals[:, chosen]
    system[size, :size] = system[:size, size] = 1
    right = np.append(-2 * residuals[:, chosen].T @ (residuals @ bound), 1 - bound.sum())
    bound[chosen] = np.linalg.solve(system, right)[:size]
    return bound


@pytest.mark.parametrize("slack", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(10))
def test_a_second_solver_finds_the_same(seed, slack):
    rng = np.random.default_rng(seed)
    columns, target = rng.normal(size=(40, 12)) * 100, rng.normal(size=40) * 60
    coefficients = simplex_least_squares(columns, target, slack=slack)
    assert np.abs(coefficients - by_active_set(columns, target, slack)).max() < 1e-6
    assert coefficients.min() >= -slack
    assert abs(coefficients.sum() - 1) < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_with_a_penalty_no_exchange_between_two_columns_is_better(seed):
    rng = np.random.default_rng(seed)
    columns, target = rng.normal(size=(20, 6)), rng.normal(size=20)
    penalty = rng.uniform(0, 5, 6)
    coefficients = simplex_least_squares(columns, target, penalty=penalty)
    slopes = 2 * columns.T @ (columns @ coefficients - target) + penalty
    # Karush, Kuhn and Tucker: the same slope wherever there is a share, none lower.
    used = coefficients > 1e-6
    assert np.ptp(slopes[used]) < 1e-5
    assert slopes.min() > slopes[used].max() - 1e-5


@pytest.mark.parametrize("seed", [63, 96, 248, 557])
def test_where_rounding_stops_the_solver_early(seed):
    """Columns far from 0, some the same, and costs of all sizes: what is reached is the least."""
    rng = np.random.default_rng(seed)
    rows, count = rng.integers(2, 80), rng.integers(2, 50)
    columns = rng.normal(size=(rows, count)) * 10 ** rng.uniform(-1, 3)
    columns += rng.normal() * 10 ** rng.uniform(0, 3)
    if rng.random() < 0.5:
        columns[:, count // 2 :] = columns[:, : count - count // 2]
    target = columns @ rng.dirichlet(np.ones(count))
    target += rng.normal(size=rows) * rng.choice([0, 1, 100])
    rng.random()
    penalty = rng.uniform(0, 1, count) * 10 ** rng.uniform(-3, 4)
    coefficients = simplex_least_squares(columns, target, penalty=penalty)
    slopes = 2 * columns.T @ (columns @ coefficients - target) + penalty
    # A convex cost is no farther above its least than this.
    scale = ((columns - target[:, None]) ** 2).sum(axis=0).max() + penalty.max()
    assert coefficients @ slopes - slopes.min() < 1e-6 * scale
    assert abs(coefficients.sum() - 1) < 1e-12
    assert coefficients.min() >= 0


def test_known_coefficients_are_recovered():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(30, 8))
    truth = np.array([0.5, 0, 0.2, 0, 0, 0.3, 0, 0])
    assert np.abs(simplex_least_squares(columns, columns @ truth) - truth).max() < 1e-6


def test_outside_of_the_hull_the_nearest_corner_is_the_solution():
    columns = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert simplex_least_squares(columns, [5.0, -3.0]) == pytest.approx([0, 1, 0], abs=1e-8)


def test_a_single_column_has_coefficient_one():
    assert simplex_least_squares([[3.0], [4.0]], [9.0, 9.0]) == pytest.approx([1.0])


def test_equal_columns_have_equal_coefficients():
    columns = np.array([[1.0, 1.0, 3.0]])
    coefficients = simplex_least_squares(columns, [2.0])
    assert columns @ coefficients == pytest.approx([2.0], abs=1e-6)
    assert coefficients.min() >= 0
    same = simplex_least_squares(np.ones((4, 3)), np.ones(4))
    assert same.sum() == pytest.approx(1.0)


def test_the_cost_does_not_depend_on_units():
    rng = np.random.default_rng(4)
    columns, target = rng.normal(size=(20, 6)), rng.normal(size=20)
    large = simplex_least_squares(1e6 * columns, 1e6 * target)
    assert np.abs(simplex_least_squares(columns, target) - large).max() < 1e-7


@pytest.mark.parametrize(
    ("columns", "target", "options", "message"),
    [
        (np.zeros((2, 0)), np.zeros(2), {}, "at least one"),
        (np.zeros((2, 3)), np.zeros(3), {}, "target"),
        ([[np.nan]], [0.0], {}, "finite"),
        ([[1.0]], [0.0], {"slack": -0.1}, "slack"),
        ([[1.0]], [0.0], {"penalty": [1.0, 2.0]}, "penalty"),
    ],
)
def test_bad_input_is_named(columns, target, options, message):
    with pytest.raises(InputError, match=message):
        simplex_least_squares(columns, target, **options)


@pytest.mark.filterwarnings("ignore:overflow")
def test_numbers_too_large_are_refused():
    with pytest.raises(EstimationError, match="too large"):
        simplex_least_squares([[1e200, 0.0]], [0.0])
