"""Steps that cannot be told from noise are mostly not taken: a still head holds still.

Each block of unknowns (pose, one region's expression, units, gaze) is believed either to stay or to
move clearly. How far the frame's own answer lies from the frame before, in standard deviations of
that answer, tells which; a motion of a few deviations passes whole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float, Int

LEAST_GAIN = 0.2
"""Share of a step that is taken when it is all noise."""
_CLEAR = 3.0
"""Standard deviations at which the other shares are half way to all of it."""


def steady_step(
    step: Float[Array, " n"], information: Float[Array, "n n"], blocks: Sequence[Int[Array, " m"]]
) -> Float[Array, " n"]:
    """(N,) the step from the frame before that is likeliest, given the frame's own.

    Minimizes (x - step)' A (x - step) plus, for each block, x_b' L_b x_b: A is the information of
    the frame, L_b the inverse covariance of the block's answer times (1 - k) / k, and k grows from
    LEAST_GAIN to 1 with the block's distance.

    Args:
        step: (N,) from the frame before to this frame's answer.
        information: (N, N) inverse covariance of the answer.
        blocks: unknowns that move or stay together; unknowns in none of them are free.
    """
    covariance = np.linalg.inv(information)
    matrix = information.copy()
    for block in blocks:
        if not len(block):
            continue
        own = np.linalg.inv(covariance[np.ix_(block, block)])
        distance = float(step[block] @ own @ step[block]) / len(block)
        gain = LEAST_GAIN + (1 - LEAST_GAIN) * distance**2 / (distance**2 + _CLEAR**4)
        matrix[np.ix_(block, block)] += (1 - gain) / gain * own
    taken: Array = np.linalg.solve(matrix, information @ step)
    return taken
