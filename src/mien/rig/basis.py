"""Blending weights of basic expressions, and their minimal parameters.

Weights of m expressions that sum to 1 form a hyperplane, which has m - 1 parameters:
w = Q alpha + w*. Source: [Pighin 2002] sec. 6.1.1, eq. (4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.errors import InputError

WEIGHT_RANGE = (-0.5, 1.5)
"""The lowest and the highest weight allowed; beyond it faces look unnatural.

Source: [Pighin 2002] sec. 6.1.1.
"""

_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Basis:
    """The map between blending weights and expression parameters: w = Q alpha + w*.

    Attributes:
        Q: (m, k) linearly independent columns, each of which sums to 0; k = m - 1 reaches every
            mixture of the m expressions, fewer columns only some.
        w_star: (m,) sums to 1: the weights at alpha = 0, the mean of all expressions.

    Raises:
        InputError: sums that differ from these, columns that depend on each other.

    Source:
        [Pighin 2002] sec. 6.1.1, eq. (4).
    """

    Q: Float[Array, "m k"]
    w_star: Float[Array, " m"]

    def __post_init__(self) -> None:
        Q = check_array("Q", self.Q, (None, None))
        w_star = check_array("w_star", self.w_star, (len(Q),))
        if np.abs(Q.sum(axis=0)).max(initial=0.0) > _TOLERANCE:
            raise InputError("Q", "columns that sum to 0", f"sums {Q.sum(axis=0)}")
        if Q.shape[1] and np.linalg.matrix_rank(Q) < Q.shape[1]:
            raise InputError("Q", "linearly independent columns", f"{Q.shape[1]} that are not")
        if abs(w_star.sum() - 1) > _TOLERANCE:
            raise InputError("w_star", "weights that sum to 1", f"the sum {w_star.sum():.6g}")
        object.__setattr__(self, "Q", frozen(Q))
        object.__setattr__(self, "w_star", frozen(w_star))

    @classmethod
    def by_differences(cls, m: int, *, reference: int = 0) -> Basis:
        """One parameter for each expression but the reference: the weight of their difference.

        Args:
            m: number of expressions.
            reference: index of one of them.

        Raises:
            InputError: no expression, a reference that is none of them.
        """
        if m < 1:
            raise InputError("m", "at least one expression", m)
        if not 0 <= reference < m:
            raise InputError("reference", f"an expression from 0 to {m - 1}", reference)
        Q = np.delete(np.eye(m), reference, axis=1)
        Q[reference] = -1
        return cls(Q, np.full(m, 1 / m))

    @classmethod
    def by_gram_schmidt(cls, m: int, *, reference: int = 0) -> Basis:
        """The differences orthonormalized by Gram and Schmidt, in their order.

        Args:
            m: number of expressions.
            reference: index of one of them.

        Raises:
            InputError: no expression, a reference that is none of them.
        """
        differences = cls.by_differences(m, reference=reference)
        Q, R = np.linalg.qr(differences.Q)
        # Householder's reflections may flip a direction; Gram and Schmidt's method does not.
        return cls(Q * np.sign(np.diag(R)), differences.w_star)

    @classmethod
    def by_pca(cls, examples: Float[Array, "m d"], *, count: int | None = None) -> Basis:
        """Orthonormal directions along which the expressions differ most, the greatest first.

        A step of length 1 along a column changes geometry and texture by that column's singular
        value; columns do so independently of each other. Where expressions are alike, the last
        columns change nothing and can be left out by `count`.

        Args:
            examples: (m, d) geometry (and texture) of each expression as one row, in units that
                make its parts comparable.
            count: how many columns to keep, 0 to m - 1; all by default.

        Raises:
            InputError: no expression, NaN, another count.
        """
        examples = check_array("examples", examples, (None, None))
        plane = cls.by_gram_schmidt(len(examples))
        span = plane.Q.T @ examples
        _, directions = np.linalg.eigh(span @ span.T)
        Q = plane.Q @ directions[:, ::-1]
        count = Q.shape[1] if count is None else count
        if not 0 <= count <= Q.shape[1]:
            raise InputError("count", f"0 to {Q.shape[1]} columns", count)
        # An eigenvector's sign is free: the expression that leads a direction is its positive end.
        leading = np.take_along_axis(Q, np.abs(Q).argmax(axis=0, keepdims=True), axis=0)
        return cls((Q * np.sign(leading))[:, :count], plane.w_star)

    def weights(self, alpha: Float[Array, "*batch k"]) -> Float[Array, "*batch m"]:
        """Blending weights, which sum to 1. Raises: InputError: another number of parameters."""
        alpha = np.asarray(alpha, dtype=np.float64)
        _check_last_axis("alpha", alpha, self.Q.shape[1])
        return alpha @ self.Q.T + self.w_star

    def alpha(self, weights: Float[Array, "*batch m"]) -> Float[Array, "*batch k"]:
        """Least-squares parameters of these weights; exact in the span of Q.

        Raises:
            InputError: another number of weights.
        """
        weights = np.asarray(weights, dtype=np.float64)
        _check_last_axis("weights", weights, len(self.Q))
        return (weights - self.w_star) @ self._inverse.T

    @cached_property
    def _inverse(self) -> Float[Array, "k m"]:
        return np.linalg.pinv(self.Q)


def check_weights(
    weights: Float[Array, "*batch m"], *, name: str = "weights"
) -> Float[Array, "*batch m"]:
    """Blending weights as float64.

    Args:
        weights: one for each expression along the last axis.
        name: for the message of an error.

    Raises:
        InputError: not finite, a sum that is off 1 by more than 1e-6, one that lies outside
            WEIGHT_RANGE.
    """
    weights = np.asarray(weights)
    weights = check_array(name, weights, (None,) * max(weights.ndim, 1))
    low, high = WEIGHT_RANGE
    outside = (weights < low - _TOLERANCE) | (weights > high + _TOLERANCE)
    if outside.any():
        raise InputError(name, f"weights from {low} to {high}", f"{weights[outside][0]:.6g}")
    sums = np.atleast_1d(weights.sum(axis=-1))
    wrong = np.abs(sums - 1) > _TOLERANCE
    if wrong.any():
        raise InputError(name, "weights that sum to 1", f"the sum {sums[wrong][0]:.6g}")
    return weights


def outside_hull(
    weights: Float[Array, "*batch m"], names: Sequence[str] | None = None
) -> str | None:
    """A warning for weights outside 0 to 1, which extrapolate the photographed expressions.

    Args:
        weights: one for each expression along the last axis.
        names: of the expressions; counted from 0 by default.

    Returns:
        one line that names the expressions with their farthest weight; None when every mixture lies
        within the convex hull of the photographed expressions.
    """
    rows = np.asarray(weights, dtype=np.float64).reshape(-1, np.shape(weights)[-1])
    names = [str(index) for index in range(rows.shape[1])] if names is None else names
    beyond = np.maximum(-rows, rows - 1)
    farthest = rows[beyond.argmax(axis=0), np.arange(rows.shape[1])]
    extrapolated = [
        f"{name} {weight:.3g}"
        for name, weight, excess in zip(names, farthest, beyond.max(axis=0), strict=True)
        if excess > _TOLERANCE
    ]
    if not extrapolated:
        return None
    return f"past what was photographed (weights outside 0 to 1): {', '.join(extrapolated)}"


def _check_last_axis(name: str, array: Array, length: int) -> None:
    if array.ndim == 0 or array.shape[-1] != length:
        raise InputError(name, f"{length} along the last axis", f"shape {array.shape}")
