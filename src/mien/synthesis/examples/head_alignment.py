"""Head motion in the image plane, undone."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.numeric.planar_similarity import PlanarMotion, estimate_planar_motion

__all__ = ["compensated"]


def compensated(
    points: Float[Array, "*batch n 2"],
    neutral: Float[Array, "n 2"],
    *,
    by: Int[Array, " k"] | None = None,
) -> tuple[Float[Array, "*batch n 2"], PlanarMotion]:
    """Geometries: the points with the head's motion since the neutral face undone.

    Args:
        points: (..., N, 2) px, of faces with expressions.
        neutral: (N, 2) px, the same points of the neutral face; N >= 2.
        by: indices of the points that tell the motion; all unless given. Displacements learned from
            and those of a few points to be completed must be told by the same.

    Returns:
        (..., N, 2) px of the neutral face's image; the motion from there to the points.

    Raises:
        InputError: as `estimate_planar_motion`.
        EstimationError: as `estimate_planar_motion`.

    Source:
        [Zhang 2006] sec. 12, T^-1(x') after eq. (9); less the neutral points it is the
        displacement.
    """
    neutral = check_array("neutral", neutral, (None, 2))
    points = check_array("points", points, (*np.shape(points)[:-2], *neutral.shape))
    told = slice(None) if by is None else by
    motion = estimate_planar_motion(neutral[told], points[..., told, :])
    return motion.undo(points), motion
