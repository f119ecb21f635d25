"""Levenberg-Marquardt: the loop; the problem supplies its cost, linearization and update."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

__all__ = ["LevenbergMarquardtResult", "minimize_lm"]

X = TypeVar("X")
S = TypeVar("S")
_MIN_DAMPING, _MAX_DAMPING = 1e-12, 1e12


@dataclass(frozen=True)
class LevenbergMarquardtResult(Generic[X]):
    """The result of the iteration.

    Attributes:
        x: the parameters.
        cost: at x.
        iterations: linearizations made.
        converged: False where the limit on iterations came first.
    """

    x: X
    cost: float
    iterations: int
    converged: bool


def minimize_lm(
    x: X,
    *,
    cost: Callable[[X], float],
    linearize: Callable[[X], Callable[[float], tuple[S, float]]],
    move: Callable[[X, S], X],
    damping: float = 1e-3,
    max_iterations: int = 100,
    tolerance: float = 1e-10,
    max_failures: int | None = None,
) -> LevenbergMarquardtResult[X]:
    """A local minimum of the cost, from x.

    Args:
        x: initial parameters.
        cost: half the sum of squares (or its robust counterpart).
        linearize: at x, gives the function that, for a damping relative to the normal matrix's
            diagonal, solves for a step and predicts by how much the cost falls.
        move: x after a step (rotations stay rotations).
        damping: the first one.
        max_iterations: linearizations at most.
        tolerance: predicted relative fall of the cost at which it has converged.
        max_failures: rejected steps in a row after which it counts as converged, for callers with
            little time; None sets no limit.

    Source:
        Nielsen, Damping parameter in Marquardt's method, 1999 (how damping follows the gain).
    """
    value, growth = cost(x), 2.0
    for iteration in range(1, max_iterations + 1):
        solve, failures = linearize(x), 0
        while True:
            step, predicted = solve(damping)
            if not predicted > tolerance * value:
                return LevenbergMarquardtResult(x, value, iteration, True)
            moved = move(x, step)
            moved_value = cost(moved)
            gain = (value - moved_value) / predicted
            if np.isfinite(moved_value) and gain > 0:
                break
            damping, growth, failures = damping * growth, 2 * growth, failures + 1
            if damping > _MAX_DAMPING or failures == max_failures:
                return LevenbergMarquardtResult(x, value, iteration, True)
        damping = max(damping * max(1 / 3, 1 - (2 * gain - 1) ** 3), _MIN_DAMPING)
        growth, x, value = 2.0, moved, moved_value
    return LevenbergMarquardtResult(x, value, max_iterations, False)
