"""The mixture of columns that comes nearest to a target."""

from __future__ import annotations

from functools import cache

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.errors import EstimationError, InputError

__all__ = ["simplex_least_squares", "simplex_quadratic_program"]

_ACCURACIES = (1e-12, 1e-8, 1e-6)
"""Of a cost whose greatest coefficient is 2: the best that rounding lets the solver reach."""


def simplex_least_squares(
    columns: Float[Array, "d m"],
    target: Float[Array, " d"],
    *,
    slack: float = 0.0,
    penalty: Float[Array, " m"] | None = None,
) -> Float[Array, " m"]:
    """Shares c that minimise |columns c - target|^2 + penalty . c, found by an interior point.

    Where several mixtures are equally near, as with columns that are the same, one of them.

    Args:
        columns: (d, m) what is mixed.
        target: (d,).
        slack: how far below 0 a share may go; above 0, the mixture may leave the convex hull.
        penalty: (m,) cost of a column's share, in the square of the target's unit.

    Returns:
        (m,) shares that sum to 1, none below -slack.

    Raises:
        InputError: shapes, NaN, no column, a slack below 0.
        EstimationError: numbers so large that the solver does not converge.

    Source:
        [Zhang 2006] section 6, eq. (2) to (5); slack and penalty are not the paper's.
    """
    columns = check_array("columns", columns, (None, None))
    target = check_array("target", target, (len(columns),))
    count = columns.shape[1]
    if count == 0:
        raise InputError("columns", "at least one", "none")
    if not (np.isfinite(slack) and slack >= 0):
        raise InputError("slack", "a number of at least 0", slack)
    costs = np.zeros(count) if penalty is None else check_array("penalty", penalty, (count,))
    # Shares sum to 1: the target taken from each column leaves the cost as it is, with smaller
    # numbers than eq. (5)'s and none linear.
    apart = columns - target[:, None]
    return simplex_quadratic_program(apart.T @ apart, slack=slack, penalty=costs)


def simplex_quadratic_program(
    products: Float[Array, "m m"], *, slack: float = 0.0, penalty: Float[Array, " m"]
) -> Float[Array, " m"]:
    """The same from the columns' products with each other, when the target is taken from each.

    Unlike `simplex_least_squares` it looks at nothing: for many small problems, each of which takes
    20 us, that would be most of the time.

    Raises:
        EstimationError: as there.
    """
    scale = max(float(products.diagonal().max()), float(np.abs(penalty).max()))
    if scale == 0.0:
        return frozen(np.full(len(products), 1.0 / len(products)))
    if not np.isfinite(scale):
        raise EstimationError("columns and target are too large to be squared")
    return frozen(_solved(2.0 * products / scale, penalty / scale, slack))


def _solved(quadratic: Array, linear: Array, slack: float) -> Float[Array, " m"]:
    count = len(linear)
    shares = _interior(quadratic, linear, slack)
    # An interior point keeps off the bounds by its accuracy.
    above = np.maximum(shares + slack, 0.0)
    above[above < 1e-9] = 0.0
    return above * ((1.0 + count * slack) / above.sum()) - slack


def _interior(quadratic: Array, linear: Array, slack: float) -> Float[Array, " m"]:
    """As accurate as it can be had: columns that are the same, and great costs, cost digits."""
    import piqp

    count = len(linear)
    for accuracy in _ACCURACIES:
        solver = piqp.DenseSolver()
        solver.settings.eps_abs = solver.settings.eps_duality_gap_abs = accuracy
        solver.settings.eps_rel = solver.settings.eps_duality_gap_rel = 0.0
        solver.setup(
            np.asfortranarray(quadratic),
            linear,
            *_sum_of_one(count),
            x_l=np.full(count, -slack),
        )
        status = solver.solve()
        if status == piqp.PIQP_SOLVED:
            return np.array(solver.result.x, np.float64)
    raise EstimationError(f"no nearest mixture was found: {status}")


@cache
def _sum_of_one(count: int) -> tuple[Array, Array]:
    """The equation that shares fulfil, its left side and its right."""
    return frozen(np.ones((1, count), order="F")), frozen(np.ones(1))
