"""Similarities (scale, rotation, translation) in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.errors import EstimationError, InputError

__all__ = ["PlanarSimilarity", "estimate_planar_similarity"]

_MIN_SPREAD = 1e-9
"""Points nearer to each other than this part of their coordinates coincide."""


@dataclass(frozen=True)
class PlanarSimilarity:
    """(x, y) -> [[a, -b], [b, a]] (x, y) + (tx, ty), one or a batch of any shape.

    Attributes:
        a: (...) scale times the cosine of the rotation.
        b: (...) scale times the sine of the rotation.
        translation: (..., 2) px.

    Source:
        [Zhang 2006] eq. (8).
    """

    a: Float[Array, "*batch"]
    b: Float[Array, "*batch"]
    translation: Float[Array, "*batch 2"]

    @property
    def scale(self) -> Float[Array, "*batch"]:
        """Ratio of lengths after the motion to those before."""
        return np.hypot(self.a, self.b)

    def __call__(self, points: Float[Array, "*batch n 2"]) -> Float[Array, "*batch n 2"]:
        """The points after the motion."""
        return _turned(self.a, self.b, points) + self.translation[..., None, :]

    def inverse(self, points: Float[Array, "*batch n 2"]) -> Float[Array, "*batch n 2"]:
        """The points before the motion, from those after it."""
        squared = self.scale**2
        return _turned(self.a / squared, -self.b / squared, points - self.translation[..., None, :])


def estimate_planar_similarity(
    source: Float[Array, "n 2"], target: Float[Array, "*batch n 2"]
) -> PlanarSimilarity:
    """The similarities in the plane that take source nearest to target by least squares.

    Args:
        source: (N, 2), N >= 2, that do not all coincide.
        target: (..., N, 2) the same points after the motion.

    Raises:
        InputError: shapes, NaN, fewer than two points.
        EstimationError: the points of the source coincide, or those of a target do.

    Source:
        [Zhang 2006] sec. 12, eq. (8), (9).
    """
    source = check_array("source", source, (None, 2))
    if len(source) < 2:
        raise InputError("source", "at least 2 points", len(source))
    target = check_array("target", target, (*np.shape(target)[:-2], len(source), 2))
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=-2)
    x, y = (source - source_mean).T
    across, down = np.moveaxis(target - target_mean[..., None, :], -1, 0)
    spread = float(x @ x + y @ y)
    _check_spread("those at rest", spread, source)
    a, b = (across @ x + down @ y) / spread, (down @ x - across @ y) / spread
    _check_spread("those that moved", (a * a + b * b) * spread, target)
    turned = _turned(a, b, source_mean[None])[..., 0, :]
    return PlanarSimilarity(a, b, target_mean - turned)


def _turned(a: Array, b: Array, points: Array) -> Array:
    x, y = points[..., 0], points[..., 1]
    a, b = np.asarray(a)[..., None], np.asarray(b)[..., None]
    return np.stack([a * x - b * y, b * x + a * y], axis=-1)


def _check_spread(what: str, spread: Array | float, points: Array) -> None:
    """Compare squared distances from the mean, summed, with the size of the numbers."""
    if (np.asarray(spread) <= (_MIN_SPREAD * np.abs(points).max(initial=1e-300)) ** 2).any():
        raise EstimationError(
            f"motion in the plane needs points apart from each other; {what} share a place"
        )
