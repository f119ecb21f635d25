"""Shrinkage of steps that are not significant, so that a still head holds still.

A frame determines some motions well, such as a shift within the picture, and others badly, such as
a turn of the head against a shift or against a motion of the mouth. So each block of unknowns
(pose, one region's expression, units, gaze) is split along the principal axes of its covariance.
Along each, a fraction of the step is taken that grows with its significance. A block that moves
clearly along one axis is shrunk less along the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int

MIN_GAIN = 0.15
"""Fraction of a step that is taken when it is all noise: the deviation of a still state becomes
sqrt(k / (2 - k)) = 0.28 of one frame's."""
_SHARED = 0.3
"""Fraction of a block's mean squared distance that is added along each of its axes."""


class ParameterBlock(NamedTuple):
    """Unknowns whose steps are shrunk together.

    Attributes:
        unknowns: (M,) their indices.
        scale: (M,) typical steps in a frame: the units in which axes are compared.
        threshold: standard deviations above which a step is taken for motion.
    """

    unknowns: Int[Array, " m"]
    scale: Float[Array, " m"]
    threshold: float


def shrink_step(
    step: Float[Array, " n"], information: Float[Array, "n n"], blocks: Sequence[ParameterBlock]
) -> Float[Array, " n"]:
    """(N,) the step of highest posterior, given the frame's own.

    Minimizes (x - step)' A (x - step) plus x_b' L_b x_b for each block. A is the information of
    the frame; L_b has the axes of the block's covariance and, along each, (1 - k) / k over the
    variance: if the other blocks agree, a fraction k of the step is taken.

    Args:
        step: (N,) from the frame before to this frame's solution.
        information: (N, N) inverse covariance of the solution.
        blocks: disjoint; unknowns in none of them are not shrunk.
    """
    covariance = np.linalg.inv(information)
    matrix = information.copy()
    for unknowns, scale, threshold in blocks:
        if not len(unknowns):
            continue
        own = np.ix_(unknowns, unknowns)
        variances, axes = np.linalg.eigh(covariance[own] / np.outer(scale, scale))
        axes = axes.T / scale
        gains = _gains((axes @ step[unknowns]) ** 2 / variances, threshold)
        matrix[own] += axes.T @ np.diag((1 - gains) / gains / variances) @ axes
    return np.linalg.solve(matrix, information @ step)


def _gains(squares: Float[Array, " m"], threshold: float) -> Float[Array, " m"]:
    """Fractions of a step that are taken, from its squared distances in standard deviations.

    1 less a fourth power: the rest is never more than 0.57 (1 - MIN_GAIN) `threshold` deviations,
    and soon nothing where the motion is faster.
    """
    squares = squares + _SHARED * squares.mean()
    significance: Array = squares**2 / (squares**2 + threshold**4)
    return MIN_GAIN + (1 - MIN_GAIN) * significance
