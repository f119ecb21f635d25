"""Shape from feature points: the cameras stay, the head's vertices follow."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.errors import EstimationError, InputError
from mien.numeric.rbf import fit_rbf

__all__ = ["refine_shape"]


def refine_shape(
    vertices: Float[Array, "v 3"],
    feature_vertices: Int[Array, " n"],
    feature_points: Float[Array, "n 3"],
    *,
    kernel: str = "exponential",
    radius: float | None = None,
    smoothing: float = 0.0,
    weights: Float[Array, " n"] | None = None,
) -> Float[Array, "v 3"]:
    """All vertices moved so that the feature vertices come to lie on the feature points.

    Can be repeated, each time on the last result, with points from `intersect_rays`.

    Args:
        vertices: (V, 3) mm. feature_vertices: (N,) indices into them.
        feature_points: (N, 3) mm, where those vertices belong; rows with NaN are not known and
            are passed over. A vertex named twice goes to the mean of its points.
        kernel, radius, smoothing: as in fit_rbf; smoothing 0 meets every point.
        weights: (N,) >= 0; smoothing is divided by them, and weight 0 drops a point.
    Raises: InputError: shapes, an index out of range, negative weights.
        EstimationError: no feature point is known.
    Source: P02 sec. 5.1.2 and 5.1.3.
    """
    vertices = check_array("vertices", vertices, (None, 3))
    chosen = check_array("feature_vertices", feature_vertices, (None,), dtype=np.int64)
    if chosen.size and not (chosen.min() >= 0 and chosen.max() < len(vertices)):
        raise InputError("feature_vertices", f"indices from 0 to {len(vertices) - 1}", chosen.max())
    goals = check_array("feature_points", feature_points, (len(chosen), 3), finite=False)
    trust = np.ones(len(chosen)) if weights is None else weights
    trust = check_array("weights", trust, (len(chosen),))
    if (trust < 0).any():
        raise InputError("weights", "numbers of 0 or more", trust.min())
    known = np.isfinite(goals).all(axis=1) & (trust > 0)
    if not known.any():
        raise EstimationError("no feature point is known: nothing tells where the vertices belong")
    places = vertices[chosen[known]]
    displacement = fit_rbf(
        places,
        goals[known] - places,
        kernel=kernel,
        radius=radius,
        smoothing=smoothing / trust[known],
    )
    moved: Array = vertices + displacement(vertices)
    return moved
