"""A Gaussian process over the face, for displacements unlike those of the statistics."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, check_array

__all__ = ["matern32", "smallest_variance"]

_LENGTH_SCALE = 0.2
"""Face widths."""


def matern32(points: Float[Array, "n 2"]) -> Float[Array, "n n"]:
    """Correlation of the residual displacements of points: 1 at distance 0, then falling.

    Args:
        points: (n, 2) in widths of the face.

    Raises:
        InputError: shape, NaN.

    Source:
        the Matern covariance with smoothness 3/2: once differentiable, so that the displacements
        have no creases, and well conditioned for points side by side.
    """
    points = check_array("points", points, (None, 2))
    scaled = np.sqrt(3) * np.linalg.norm(points[:, None] - points, axis=2) / _LENGTH_SCALE
    return (1 + scaled) * np.exp(-scaled)


def smallest_variance(
    covariance: Float[Array, "q q"],
    correlation: Float[Array, "q q"],
    residual: Float[Array, " q"],
    max_deviations: float,
) -> tuple[float, Float[Array, " q"]]:
    """The least variance of the process that makes the observations likely enough.

    Args:
        covariance: (q, q) of the observed numbers under the statistics.
        correlation: (q, q) of the process at them.
        residual: (q,) the observed numbers less their mean, more than `max_deviations` under
            `covariance` alone.
        max_deviations: root mean square of the whitened residual, in standard deviations.

    Returns:
        the variance s at which it is just `max_deviations`; (q,) (covariance + s correlation)^-1
        residual.
    """
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, np.linalg.solve(factor, correlation).T)
    eigenvalues, eigenvectors = np.linalg.eigh(whitened)
    eigenvalues = np.maximum(eigenvalues, 0)
    projected = eigenvectors.T @ np.linalg.solve(factor, residual)
    low, high = 0.0, 1.0
    while _deviations(projected, eigenvalues, high) > max_deviations and high < 1e30:
        low, high = high, 4 * high
    for _ in range(50):
        middle = (low + high) / 2
        above = _deviations(projected, eigenvalues, middle) > max_deviations
        low, high = (middle, high) if above else (low, middle)
    scaled = projected / (1 + high * eigenvalues)
    weights: Array = np.linalg.solve(factor.T, eigenvectors @ scaled)
    return high, weights


def _deviations(projected: Array, eigenvalues: Array, variance: float) -> float:
    return float(np.sqrt(np.mean(projected**2 / (1 + variance * eigenvalues))))
