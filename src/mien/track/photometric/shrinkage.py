"""Steps that cannot be told from noise are mostly not taken: a still head holds still.

A frame tells some motions well, such as a shift within the picture, and others badly, such as a
turn of the head against a shift, or against what the mouth does. So each block of unknowns (pose,
one region's expression, units, gaze) is looked at along the directions in which its errors are
independent: in each, the step is taken in part or whole, the clearer the more. Where a block moves
very clearly in one direction, it is not expected to stand still in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int

LEAST_GAIN = 0.15
"""Share of a step that is taken when it is all noise: the deviation of a still state becomes
sqrt(k / (2 - k)) = 0.28 of one frame's."""
_CARRIED = 0.3
"""Of a block's mean squared distance, that counts in each of its directions."""


class Block(NamedTuple):
    """Unknowns that move or stay together.

    Attributes:
        unknowns: (M,) which.
        usual: (M,) how far they go in a frame: the units in which directions are compared.
        clear: standard deviations from which on a step is rather motion than noise.
    """

    unknowns: Int[Array, " m"]
    usual: Float[Array, " m"]
    clear: float


def steady_step(
    step: Float[Array, " n"], information: Float[Array, "n n"], blocks: Sequence[Block]
) -> Float[Array, " n"]:
    """(N,) the step from the frame before that is likeliest, given the frame's own.

    Minimizes (x - step)' A (x - step) plus x_b' L_b x_b for each block. A is the information of
    the frame; L_b has the axes of the block's covariance and, along each, (1 - k) / k over the
    variance: if the other blocks agree, a share k of the step is taken.

    Args:
        step: (N,) from the frame before to this frame's answer.
        information: (N, N) inverse covariance of the answer.
        blocks: disjoint; unknowns in none of them are free.
    """
    covariance = np.linalg.inv(information)
    matrix = information.copy()
    for unknowns, usual, clear in blocks:
        if not len(unknowns):
            continue
        own = np.ix_(unknowns, unknowns)
        variances, axes = np.linalg.eigh(covariance[own] / np.outer(usual, usual))
        axes = axes.T / usual
        gains = _gains((axes @ step[unknowns]) ** 2 / variances, clear)
        matrix[own] += axes.T @ np.diag((1 - gains) / gains / variances) @ axes
    return np.linalg.solve(matrix, information @ step)


def _gains(squares: Float[Array, " m"], clear: float) -> Float[Array, " m"]:
    """Shares of a step that are taken, from its squared distances in standard deviations.

    1 less a fourth power: what stays behind is never more than 0.57 (1 - LEAST_GAIN) `clear`
    deviations, and soon nothing where the motion is faster.
    """
    squares = squares + _CARRIED * squares.mean()
    clearly: Array = squares**2 / (squares**2 + clear**4)
    return LEAST_GAIN + (1 - LEAST_GAIN) * clearly
