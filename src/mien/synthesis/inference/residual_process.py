"""Points that are given where nobody saw them: how far a face bends to follow."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, check_array

__all__ = ["closeness", "least_bend"]

_REACH = 0.2
"""Of a bend, in the unit of the places: face widths."""


def closeness(places: Float[Array, "n 2"]) -> Float[Array, "n n"]:
    """How much points bend together: 1 with themselves, falling with the distance.

    Args:
        places: (n, 2) in widths of the face.

    Raises:
        InputError: shape, NaN.

    Source:
        the covariance of Matern with smoothness 3/2: once differentiable, so that bends have no
        edges, and well conditioned for points side by side.
    """
    places = check_array("places", places, (None, 2))
    apart = np.sqrt(3) * np.linalg.norm(places[:, None] - places, axis=2) / _REACH
    return (1 + apart) * np.exp(-apart)


def least_bend(
    usual: Float[Array, "q q"],
    bend: Float[Array, "q q"],
    given: Float[Array, " q"],
    most: float,
) -> tuple[float, Float[Array, " q"]]:
    """How large bends must be for what is given to be no more than so many deviations away.

    Args:
        usual: (q, q) covariance of the given numbers.
        bend: (q, q) covariance of a bend of size 1.
        given: (q,) less their mean, with more than `most` usual deviations.
        most: root of the mean square, in deviations.

    Returns:
        the variance s of bends at which it is just `most`; (q,) (usual + s bend)^-1 given.
    """
    factor = np.linalg.cholesky(usual)
    inner = np.linalg.solve(factor, np.linalg.solve(factor, bend).T)
    spread, turn = np.linalg.eigh(inner)
    spread = np.maximum(spread, 0)
    along = turn.T @ np.linalg.solve(factor, given)
    low, high = 0.0, 1.0
    while _deviations(along, spread, high) > most and high < 1e30:
        low, high = high, 4 * high
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if _deviations(along, spread, middle) > most else (low, middle)
    weights: Array = np.linalg.solve(factor.T, turn @ (along / (1 + high * spread)))
    return high, weights


def _deviations(along: Array, spread: Array, variance: float) -> float:
    return float(np.sqrt(np.mean(along**2 / (1 + variance * spread))))
