"""The similarity (scale, rotation, translation) between two point sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.errors import EstimationError, InputError

__all__ = ["Similarity", "estimate_similarity"]


@dataclass(frozen=True)
class Similarity:
    """target = scale * rotation @ source + translation.

    Attributes:
        scale: above 0.
        rotation: (3, 3).
        translation: (3,) in the target's unit.
    """

    scale: float
    rotation: Float[Array, "3 3"]
    translation: Float[Array, " 3"]

    def __call__(self, points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """(N, 3) source points to target points."""
        return self.scale * points @ self.rotation.T + self.translation


def estimate_similarity(
    source: Float[Array, "n 3"],
    target: Float[Array, "n 3"],
    weights: Float[Array, " n"] | None = None,
) -> Similarity:
    """The similarity that takes source nearest to target in the least-squares sense.

    Args:
        source: (N, 3), N >= 3, not all on one line.
        target: (N, 3) the corresponding points.
        weights: (N,) >= 0; equal unless given.

    Raises:
        InputError: shapes, NaN, negative weights.
        EstimationError: points on one line.

    Source:
        Umeyama, Least-squares estimation of transformation parameters, PAMI 1991.
    """
    source = check_array("source", source, (None, 3))
    target = check_array("target", target, source.shape)
    if weights is None:
        weights = np.ones(len(source))
    weights = check_array("weights", weights, (len(source),))
    if (weights < 0).any():
        raise InputError("weights", "numbers of 0 or more", weights.min())
    if np.count_nonzero(weights) < 3:
        raise EstimationError(
            f"a similarity needs 3 weighted points, there are {np.count_nonzero(weights)}"
        )
    weights = weights / weights.sum()
    source_mean, target_mean = weights @ source, weights @ target
    from_mean = source - source_mean
    u, singular, vt = np.linalg.svd((target - target_mean).T @ (from_mean * weights[:, None]))
    if singular[1] < 1e-12 * max(singular[0], 1e-300):
        raise EstimationError("a similarity needs points that are not all on one line")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * signs) @ vt
    scale = float(singular @ signs / (weights @ (from_mean**2).sum(axis=1)))
    return Similarity(scale, rotation, target_mean - scale * rotation @ source_mean)
