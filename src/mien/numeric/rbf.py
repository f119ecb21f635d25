"""Scattered data interpolation with radial basis functions and an affine part."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, check_array, check_positive
from mien.errors import EstimationError, InputError

__all__ = ["PAPER_RADIUS", "Rbf", "fit_rbf"]

PAPER_RADIUS = 64 * 25.4
"""64 inches in mm: the radius of [Pighin 2002]'s kernel."""

# Signs make every kernel conditionally positive definite, as smoothing requires. The
# exponential is written less 1, which the side condition sum(c) = 0 cancels: with the radius of
# [Pighin 2002] all its values lie near 1 and the constant would cost half the digits.
KERNELS: dict[str, Callable[[Array], Array]] = {
    "exponential": lambda r: np.expm1(-r),
    "gaussian": lambda r: np.exp(-(r**2)),
    "biharmonic": lambda r: -r,
    "triharmonic": lambda r: r**3,
    "thin_plate": lambda r: r**2 * np.log(np.where(r > 0, r, 1.0)),
}
_MAX_BLOCK = 2_000_000
"""Kernel values computed at a time (16 MB)."""


@dataclass(frozen=True)
class Rbf:
    """f(m) = sum_i c_i phi(|m - m_i| / radius) + M m + t; made by fit_rbf.

    Attributes:
        centers: (N, 3) the points m_i.
        coefficients: (N, D) the c_i.
        origin: (3,) of the affine part.
        axes: (A, 3) of the affine part; its coordinates are axes @ (m - origin).
        affine: (1 + A, D) its constant and its slopes along the axes.
        kernel: name.
        radius: what distances are divided by.
    """

    centers: Float[Array, "n 3"]
    coefficients: Float[Array, "n d"]
    origin: Float[Array, " 3"]
    axes: Float[Array, "a 3"]
    affine: Float[Array, "b d"]
    kernel: str
    radius: float

    def __call__(self, points: Float[Array, "m 3"]) -> Float[Array, "m d"]:
        """(M, D) values at (M, 3) points. Raises: InputError: shape, NaN."""
        points = check_array("points", points, (None, 3))
        values = _affine_terms(points, self.origin, self.axes) @ self.affine
        rows = max(1, _MAX_BLOCK // len(self.centers))
        for start in range(0, len(points), rows):
            block = slice(start, start + rows)
            phi = _kernel_matrix(points[block], self.centers, self.kernel, self.radius)
            values[block] += phi @ self.coefficients
        return values


def fit_rbf(
    points: Float[Array, "n 3"],
    values: Float[Array, "n d"],
    *,
    kernel: str = "exponential",
    radius: float | None = None,
    smoothing: float | Float[Array, " n"] = 0.0,
) -> Rbf:
    """A smooth function through (or, with smoothing, near) values at scattered points.

    Points that coincide are merged and their values averaged. Where the points do not span
    space (fewer than four, on a plane, on a line) the affine part varies only along the
    directions that they do span.

    Args:
        points: (N, 3), N >= 1.
        values: (N, D).
        kernel: "exponential" (exp(-r/radius), [Pighin 2002]'s), "gaussian" (exp(-(r/radius)^2)),
            "biharmonic" (r), "triharmonic" (r^3) or "thin_plate" (r^2 log r).
        radius: the unit of r; [Pighin 2002]'s 64 inches for "exponential", required for "gaussian",
            and only a scale of the smoothing for the others (default 1).
        smoothing: added to the kernel matrix's diagonal, one number or (N,); 0 interpolates.

    Raises:
        InputError: shapes, NaN, unknown kernel, negative smoothing.
        EstimationError: the equations are singular in double precision.

    Source:
        [Pighin 2002] sec. 5.1.2, eq. (3) with sum c_i = 0 and sum c_i m_i^T = 0.
    """
    points = check_array("points", points, (None, 3))
    values = check_array("values", values, (len(points), None))
    if len(points) == 0:
        raise InputError("points", "at least one point", "none")
    radius = _check_radius(kernel, radius)
    ridge = _check_smoothing(smoothing, len(points))
    points, values, ridge = _merged(points, values, ridge)
    origin, axes = _affine_frame(points)
    terms = _affine_terms(points, origin, axes)
    matrix = _kernel_matrix(points, points, kernel, radius) + np.diag(ridge)
    coefficients = _solve_constrained(matrix, terms, values)
    affine = np.linalg.lstsq(terms, values - matrix @ coefficients, rcond=None)[0]
    return Rbf(points, coefficients, origin, axes, affine, kernel, radius)


def _check_radius(kernel: str, radius: float | None) -> float:
    if kernel not in KERNELS:
        raise InputError("kernel", " or ".join(KERNELS), kernel)
    if radius is not None:
        return check_positive("radius", radius)
    if kernel == "gaussian":
        raise InputError("radius", "a number above zero for the gaussian kernel", None)
    return PAPER_RADIUS if kernel == "exponential" else 1.0


def _check_smoothing(smoothing: float | Array, count: int) -> Float[Array, " n"]:
    ridge = check_array("smoothing", np.broadcast_to(smoothing, (count,)), (count,))
    if (ridge < 0).any():
        raise InputError("smoothing", "numbers of 0 or more", ridge.min())
    return ridge


def _merged(points: Array, values: Array, ridge: Array) -> tuple[Array, Array, Array]:
    """Coinciding points as one, with their mean value."""
    unique, group = np.unique(points, axis=0, return_inverse=True)
    if len(unique) == len(points):
        return points, values, ridge
    mean = np.zeros((len(unique), len(points)))
    mean[group, np.arange(len(points))] = 1
    mean /= mean.sum(axis=1, keepdims=True)
    return unique, mean @ values, mean @ ridge


def _affine_frame(points: Float[Array, "n 3"]) -> tuple[Array, Array]:
    """Origin and scaled axes (A, 3), A <= 3, of the directions that the points span."""
    origin = points.mean(axis=0)
    _, spread, directions = np.linalg.svd(points - origin, full_matrices=False)
    spread = spread / np.sqrt(len(points))
    spans = spread > 1e-6 * max(float(spread[0]), 1e-300)
    spans &= np.arange(len(spread)) < len(points) - 1
    return origin, directions[spans] / spread[spans, None]


def _affine_terms(points: Array, origin: Array, axes: Array) -> Float[Array, "n b"]:
    return np.column_stack([np.ones(len(points)), (points - origin) @ axes.T])


def _kernel_matrix(a: Array, b: Array, kernel: str, radius: float) -> Float[Array, "m n"]:
    from scipy.spatial.distance import cdist

    return KERNELS[kernel](cdist(a, b) / radius)


def _solve_constrained(matrix: Array, terms: Array, values: Array) -> Float[Array, "n d"]:
    """Coefficients that meet the side conditions terms^T c = 0.

    In a basis of the conditions' null space the kernel matrix is positive definite.
    """
    from scipy.linalg import LinAlgError, LinAlgWarning, solve

    free = np.linalg.qr(terms, mode="complete")[0][:, terms.shape[1] :]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            inner = solve(free.T @ matrix @ free, free.T @ values, assume_a="pos")
    except (LinAlgError, LinAlgWarning):
        raise EstimationError(
            f"interpolation through {len(matrix)} points is singular: some are too close together "
            "for this kernel and radius; add smoothing or choose a smaller radius"
        ) from None
    return free @ inner
