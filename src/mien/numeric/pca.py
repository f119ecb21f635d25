"""Principal component analysis of a few long rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.errors import InputError

__all__ = ["Pca", "fit_pca"]

_RANK_TOLERANCE = 1e-10
"""Singular values below this part of the greatest are rounding errors."""


@dataclass(frozen=True)
class Pca:
    """The affine subspace in which rows vary most.

    Attributes:
        mean: (D,) a point of the subspace.
        components: (C, D) orthonormal, the one of greatest variance first.
        deviations: (C,) standard deviations of the rows along the components.
        residual: standard deviation per coordinate outside of the subspace.
    """

    mean: Float[Array, " d"]
    components: Float[Array, "c d"]
    deviations: Float[Array, " c"]
    residual: float

    def coefficients(self, rows: Float[Array, "*n d"]) -> Float[Array, "*n c"]:
        """Coordinates, along the components, of the rows' projections onto the subspace."""
        return (rows - self.mean) @ self.components.T

    def project(self, rows: Float[Array, "*n d"]) -> Float[Array, "*n d"]:
        """The rows' projections onto the subspace."""
        return self.mean + self.coefficients(rows) @ self.components


def fit_pca(rows: Float[Array, "n d"], components: int, *, centred: bool = True) -> Pca:
    """The first principal components of the rows.

    Args:
        rows: (N, D), N >= 1; 2 or more when centred.
        components: how many, at least 1; fewer come where the rows do not span so many.
        centred: measure variation about the mean; otherwise about 0, so that the subspace contains
            0.

    Raises:
        InputError: shape, NaN, too few rows, fewer than 1 component.
    """
    rows = check_array("rows", rows, (None, None))
    if len(rows) < 1 + centred:
        raise InputError("rows", f"at least {1 + centred}", len(rows))
    if components < 1:
        raise InputError("components", "a number from 1 on", components)
    mean = rows.mean(axis=0) if centred else np.zeros(rows.shape[1])
    _, singular, directions = np.linalg.svd(rows - mean, full_matrices=False)
    degrees_of_freedom = len(rows) - centred
    rank = int(np.count_nonzero(singular > _RANK_TOLERANCE * max(singular[0], np.abs(rows).max())))
    kept = min(components, rank)
    rest = rows.shape[1] - kept
    variance = float((singular[kept:rank] ** 2).sum()) / degrees_of_freedom / max(rest, 1)
    return Pca(
        frozen(mean),
        frozen(directions[:kept]),
        frozen(singular[:kept] / np.sqrt(degrees_of_freedom)),
        float(np.sqrt(variance)),
    )
