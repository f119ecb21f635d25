"""What keeps weights in range: D(p) of P02 sec. 6.1.2, with its gradient and Hessian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float


class Penalty(NamedTuple):
    """D at one place.

    Attributes:
        value: >= 0. gradient: (N,). hessian: (N, N).
    """

    value: float
    gradient: Float[Array, " n"]
    hessian: Float[Array, "n n"]


def range_penalty(weights: Float[Array, " k"], c: float) -> Penalty:
    """c times the sum of min(0, w)^2 + max(0, w - 1)^2, by the weights themselves."""
    beyond = np.minimum(weights, 0) + np.maximum(weights - 1, 0)
    outside = np.diag((beyond != 0).astype(np.float64))
    return Penalty(float(c * (beyond**2).sum()), 2 * c * beyond, 2 * c * outside)


def by_parameters(penalty: Penalty, Q: Float[Array, "k l"]) -> Penalty:
    """The same by expression parameters, w = Q alpha + w*."""
    return Penalty(penalty.value, Q.T @ penalty.gradient, Q.T @ penalty.hessian @ Q)
