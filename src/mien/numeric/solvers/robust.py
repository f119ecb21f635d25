"""Robust losses of squared, normalised residuals: cost and the weight of the next iteration.

A loss takes u = |residual|^2 / scale^2 and returns rho(u) and rho'(u) with rho(u) ~ u for small
u. Iteratively reweighted least squares with weights rho' minimises the sum of rho.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mien.arrays import Array, Float
from mien.errors import InputError

__all__ = ["LOSSES", "Loss", "loss_named", "robust_sigma"]

Loss = Callable[[Array], tuple[Array, Array]]

CAUCHY_TUNING = 2.385
"""95 % efficient on normal residuals."""
HUBER_TUNING = 1.345


def _linear(u: Array) -> tuple[Array, Array]:
    return u, np.ones_like(u)


def _huber(u: Array) -> tuple[Array, Array]:
    radius = np.sqrt(np.maximum(u, 1e-300))
    inside = radius <= HUBER_TUNING
    return (
        np.where(inside, u, 2 * HUBER_TUNING * radius - HUBER_TUNING**2),
        np.where(inside, 1.0, HUBER_TUNING / radius),
    )


def _cauchy(u: Array) -> tuple[Array, Array]:
    v = u / CAUCHY_TUNING**2
    return CAUCHY_TUNING**2 * np.log1p(v), 1 / (1 + v)


LOSSES: dict[str, Loss] = {"linear": _linear, "huber": _huber, "cauchy": _cauchy}


def loss_named(name: str) -> Loss:
    """The loss "linear" (least squares), "huber" or "cauchy". Raises: InputError."""
    if name not in LOSSES:
        raise InputError("loss", " or ".join(LOSSES), name)
    return LOSSES[name]


def robust_sigma(distances: Float[Array, " n"], dimensions: int = 2) -> float:
    """Standard deviation per axis of Gaussian residuals, from the median of their lengths.

    Args:
        distances: (N,) lengths of residual vectors; up to half may be outliers.
        dimensions: of a residual vector, 1 to 3.
    """
    median_of_unit = {1: 0.67449, 2: 1.17741, 3: 1.53817}[dimensions]
    return float(np.median(distances)) / median_of_unit
