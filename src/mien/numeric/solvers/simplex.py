"""Least squares over the unit simplex: coefficients that are not negative and sum to 1."""

from __future__ import annotations

from functools import cache

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.errors import EstimationError, InputError

__all__ = ["simplex_least_squares", "simplex_quadratic_program"]

_ACCURACIES = (1e-12, 1e-8, 1e-6)
"""Of a cost whose greatest coefficient is 2, tried in turn: rounding limits what is reached."""


def simplex_least_squares(
    columns: Float[Array, "d m"],
    target: Float[Array, " d"],
    *,
    slack: float = 0.0,
    penalty: Float[Array, " m"] | None = None,
) -> Float[Array, " m"]:
    """Coefficients c that minimise |columns c - target|^2 + penalty . c, by an interior point.

    Where several are optimal, as with columns that are the same, one of them.

    Args:
        columns: (d, m) vectors that are combined.
        target: (d,).
        slack: how far below 0 a coefficient may go; above 0, the result may leave the convex hull.
        penalty: (m,) cost of a column's coefficient, in the square of the target's unit.

    Returns:
        (m,) coefficients that sum to 1, none below -slack.

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
    # As coefficients sum to 1, the cost is c^T G c with the Gram matrix G of the residuals below:
    # smaller numbers than eq. (5)'s, and no linear term.
    residuals = columns - target[:, None]
    return simplex_quadratic_program(residuals.T @ residuals, slack=slack, penalty=costs)


def simplex_quadratic_program(
    gram: Float[Array, "m m"], *, slack: float = 0.0, penalty: Float[Array, " m"]
) -> Float[Array, " m"]:
    """Coefficients c on the simplex that minimise c^T gram c + penalty . c.

    It checks nothing: for many small problems, each of which takes 20 us, checks would be most of
    the time.

    Args:
        gram: (m, m) products of the columns less the target with each other.
        slack: as for `simplex_least_squares`.
        penalty: (m,) as there.

    Raises:
        EstimationError: as there.
    """
    scale = max(float(gram.diagonal().max()), float(np.abs(penalty).max()))
    if scale == 0.0:
        return frozen(np.full(len(gram), 1.0 / len(gram)))
    if not np.isfinite(scale):
        raise EstimationError("columns and target are too large to be squared")
    return frozen(_solved(2.0 * gram / scale, penalty / scale, slack))


def _solved(quadratic: Array, linear: Array, slack: float) -> Float[Array, " m"]:
    count = len(linear)
    coefficients = _interior_point(quadratic, linear, slack)
    # An interior point stays off the bounds by its accuracy.
    above = np.maximum(coefficients + slack, 0.0)
    above[above < 1e-9] = 0.0
    return above * ((1.0 + count * slack) / above.sum()) - slack


def _interior_point(quadratic: Array, linear: Array, slack: float) -> Float[Array, " m"]:
    """The solution at the best accuracy that is reached: equal columns and large costs lower it."""
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
    """The constraint sum(c) = 1: its matrix and its right side."""
    return frozen(np.ones((1, count), order="F")), frozen(np.ones(1))
