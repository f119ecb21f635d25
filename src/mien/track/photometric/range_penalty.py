"""The penalty of weights out of range: D(p) of [Pighin 2002] sec. 6.1.2, with derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.rig.basis import Basis

_MAX_GAZE = np.array([0.55, 0.4])
"""Radians to the sides, and up or down: eyes turn no farther, or lids hide them."""


class RangeLimits(NamedTuple):
    """Quantities of a face that should lie from 0 to 1: directions @ parameters + offset.

    Attributes:
        directions: (M, P).
        offset: (M,).
    """

    directions: Float[Array, "m p"]
    offset: Float[Array, " m"]

    @classmethod
    def of(cls, basis: Basis, regions: int, units: int) -> RangeLimits:
        """Blending weights of all regions, units, and gaze as a fraction of its range."""
        from scipy.linalg import block_diag

        gaze = np.diag(0.5 / _MAX_GAZE)
        directions = block_diag(*[basis.Q] * regions, np.eye(units), gaze)
        offset = np.concatenate([*[basis.w_star] * regions, np.zeros(units), [0.5, 0.5]])
        return cls(frozen(directions), frozen(offset))


class Penalty(NamedTuple):
    """D(p), with derivatives by the parameters.

    Attributes:
        value: >= 0.
        gradient: (N,).
        hessian: (N, N).
    """

    value: float
    gradient: Float[Array, " n"]
    hessian: Float[Array, "n n"]


def range_penalty(
    weights: Float[Array, " k"], c: float, directions: Float[Array, "k n"]
) -> Penalty | None:
    """The sum, times c, of min(0, w)^2 + max(0, w - 1)^2; None where all are in range.

    Args:
        weights: linear functions of the parameters.
        c: weight of the penalty.
        directions: derivatives of the weights by the parameters.
    """
    beyond = np.minimum(weights, 0) + np.maximum(weights - 1, 0)
    outside = beyond != 0
    if not outside.any():
        return None
    active = directions[outside]
    gradient = 2 * c * beyond[outside] @ active
    return Penalty(float(c * beyond @ beyond), gradient, 2 * c * active.T @ active)
