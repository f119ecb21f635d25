"""Compensation of head motion in the image plane."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.numeric.planar_similarity import PlanarSimilarity, estimate_planar_similarity

__all__ = ["align_to_neutral"]


def align_to_neutral(
    points: Float[Array, "*batch n 2"],
    neutral: Float[Array, "n 2"],
    *,
    subset: Int[Array, " k"] | None = None,
) -> tuple[Float[Array, "*batch n 2"], PlanarSimilarity]:
    """Geometries: the points with the head's motion since the neutral face undone.

    Args:
        points: (..., N, 2) px, of faces with expressions.
        neutral: (N, 2) px, the same points of the neutral face; N >= 2.
        subset: indices of the points that the motion is estimated from; all unless given. The
            statistics and the points to be completed from them must be aligned by the same subset.

    Returns:
        (..., N, 2) px of the neutral face's image; the motion from there to the points.

    Raises:
        InputError: as `estimate_planar_similarity`.
        EstimationError: as `estimate_planar_similarity`.

    Source:
        [Zhang 2006] sec. 12, T^-1(x') after eq. (9); less the neutral points it is the
        displacement.
    """
    neutral = check_array("neutral", neutral, (None, 2))
    points = check_array("points", points, (*np.shape(points)[:-2], *neutral.shape))
    used = slice(None) if subset is None else subset
    motion = estimate_planar_similarity(neutral[used], points[..., used, :])
    return motion.inverse(points), motion
