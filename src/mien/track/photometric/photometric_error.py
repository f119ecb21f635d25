"""How well the drawn face explains a frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.kernels.jit import njit
from mien.track.image.frame_pyramid import BRIGHTEST, View
from mien.track.photometric.linearization import Pictures

_COUNTS = 0.25
"""Weight from which on a pixel counts."""

_LEAST_CONTRAST = 0.03
"""Grey levels, standard deviation."""


class Agreement(NamedTuple):
    """Of a face and a frame.

    Attributes:
        rms: grey levels, over the pixels that count.
        seen: their share of the face.
        likeness: correlation of frame and drawn face over them, from -1 to 1.
    """

    rms: float
    seen: float
    likeness: float


def agreement(pictures: Pictures, view: View, weights: Float[Array, "h w"]) -> Agreement:
    """Of luma, plain.

    Args:
        weights: (h, w) float32 of the pixels. What is too bright to tell is neither covered nor
            outside of the frame.
    """
    sums = np.zeros(8)
    _add(pictures, view.pixels, view.inside, weights, sums)
    shown, total, count, a, b, aa, bb, ab = sums.tolist()
    seen = total / max(shown, 1)
    if count < 2:
        return Agreement(np.inf, seen, 0.0)
    rms = np.sqrt(max(aa - 2 * ab + bb, 0) / count)
    spread = np.sqrt(max(aa - a * a / count, 0) * max(bb - b * b / count, 0))
    # A picture without any contrast is like none.
    likeness = (ab - a * b / count) / max(float(spread), _LEAST_CONTRAST**2 * count)
    return Agreement(float(rms), seen, likeness)


@njit(cache=True, nogil=True)
def _add(pictures: Pictures, pixels: Array, inside: Array, weights: Array, sums: Array) -> None:
    """Add up pixels that show the face and could tell, weights; then pixels, luma and products."""
    _, mask, drawn, target = pictures
    for row in range(len(mask)):
        for col in range(mask.shape[1]):
            if mask[row, col] == 0:
                continue
            brightest = max(pixels[row, col, 0], pixels[row, col, 1], pixels[row, col, 2])
            if inside[row, col] >= 0.5 or brightest <= BRIGHTEST:
                sums[0] += 1
            sums[1] += weights[row, col]
            if weights[row, col] > _COUNTS:
                a, b = np.float64(drawn[row, col]), np.float64(target[row, col])
                sums[2] += 1
                sums[3] += a
                sums[4] += b
                sums[5] += a * a
                sums[6] += b * b
                sums[7] += a * b
