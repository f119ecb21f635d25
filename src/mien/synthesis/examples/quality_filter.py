"""Reasons why pictures are no good as examples, whatever expression they show."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.capture.faces.landmarks import is_cut

__all__ = ["CUT", "OCCLUDED", "rejection_reasons"]

CUT, OCCLUDED = "cut by the edge of the picture", "something is before the mouth"
SMALL = "small"

_MIN_WIDTH = 0.8
"""Of the median width of the face; smaller faces show less detail."""


def rejection_reasons(
    points: Float[Array, "N n 2"], sizes: Int[Array, "N 2"], occluded: Bool[Array, " N"]
) -> tuple[str, ...]:
    """For each picture the reason to reject it, or "".

    A fault that more than half of all pictures have is ignored: it is the way they were taken.

    Args:
        points: px of each picture.
        sizes: their widths and heights.
        occluded: whether something is before the face.
    """
    widths = np.ptp(points[..., 0], axis=1)
    cut = np.array([is_cut(own, size) for own, size in zip(points, sizes, strict=True)], bool)
    relative = widths / np.median(widths)
    faults: dict[str, Array] = {CUT: cut, OCCLUDED: occluded, SMALL: relative < _MIN_WIDTH}
    reasons = [""] * len(points)
    for reason, mask in faults.items():
        if mask.mean() > 0.5:
            continue
        for row in np.flatnonzero(mask).tolist():
            detail = f", {relative[row]:.0%} of the usual width" if reason == SMALL else ""
            reasons[row] = reasons[row] or reason + detail
    return tuple(reasons)
