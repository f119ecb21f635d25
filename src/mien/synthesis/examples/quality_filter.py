"""Why pictures are no good as examples, whatever expression they show."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.capture.faces.landmarks import is_cut

__all__ = ["CUT", "OCCLUDED", "rejection_reasons"]

CUT, OCCLUDED = "cut by the edge of the picture", "something is before the mouth"
SMALL = "small"

_LEAST_WIDTH = 0.8
"""Of the usual width of the face: smaller ones have less to show."""


def rejection_reasons(
    points: Float[Array, "N n 2"], sizes: Int[Array, "N 2"], covered: Bool[Array, " N"]
) -> tuple[str, ...]:
    """For each picture the reason, or "".

    Where more than half of all pictures have a fault, it is the way they were taken: none is left
    out for it.

    Args:
        points: px of each picture.
        sizes: their widths and heights.
        covered: whether something is before the face.
    """
    widths = np.ptp(points[..., 0], axis=1)
    cut = np.array([is_cut(own, size) for own, size in zip(points, sizes, strict=True)], bool)
    share = widths / np.median(widths)
    faults: dict[str, Array] = {CUT: cut, OCCLUDED: covered, SMALL: share < _LEAST_WIDTH}
    reasons = [""] * len(points)
    for reason, found in faults.items():
        if found.mean() > 0.5:
            continue
        for row in np.flatnonzero(found).tolist():
            more = f", {share[row]:.0%} of the usual width" if reason == SMALL else ""
            reasons[row] = reasons[row] or reason + more
    return tuple(reasons)
