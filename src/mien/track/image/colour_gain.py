"""Another camera's colours: gain and bias of every frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mien.arrays import Array, Float
from mien.track.image.greyscale import LUMA

_GAIN_SD = 0.3
"""How far a camera's gain is from 1."""
_SAY = 200.0
"""How many independent observations a face's pixels are."""


@dataclass(frozen=True)
class Colours:
    """How a frame's colours come from the drawn ones: frame = gain * drawn + bias, 0 to 255.

    Attributes:
        gain: (3,).
        bias: (3,).
    """

    gain: Float[Array, " 3"] = field(default_factory=lambda: np.ones(3))
    bias: Float[Array, " 3"] = field(default_factory=lambda: np.zeros(3))

    def towards(self, other: Colours, share: float) -> Colours:
        """A part of the way to others."""
        gain = self.gain + share * (other.gain - self.gain)
        return Colours(gain, self.bias + share * (other.bias - self.bias))

    def applied(self, drawn: Float[Array, "h w 3"]) -> Float[Array, "h w 3"]:
        """The drawn picture as the frame would have it."""
        return np.asarray(drawn * self.gain + self.bias, np.float32)

    def luma_before(self, pixels: Float[Array, "h w 3"]) -> Float[Array, "h w"]:
        """Luma of a frame as the drawn picture would have it."""
        import cv2

        shares = np.array(LUMA) / self.gain
        constant = float(shares @ self.bias)
        luma = cv2.transform(pixels, np.array([[*shares, -constant]]))
        return np.asarray(luma, np.float32)


def match_colours(
    drawn: Float[Array, "h w 3"], target: Float[Array, "h w 3"], weights: Float[Array, "h w"]
) -> Colours:
    """Gain and bias of least squares.

    A plain face hardly tells one from the other: gains are believed to be near 1.
    """
    chosen = weights > 0
    if not chosen.any():
        return Colours()
    w = weights[chosen].astype(np.float64)
    x, y = drawn[chosen].astype(np.float64), target[chosen].astype(np.float64)
    total = max(float(w.sum()), 1e-9)
    mean_x, mean_y = w @ x / total, w @ y / total
    dx, dy = x - mean_x, y - mean_y
    variance = np.maximum(w @ (dx * dx), 1e-9)
    noise = np.maximum(w @ (dy - dx) ** 2 / total, 1.0)
    belief = noise / _GAIN_SD**2 * total / _SAY
    gain = (w @ (dx * dy) + belief) / (variance + belief)
    gain = np.clip(gain, 0.2, 5.0)
    return Colours(gain, mean_y - gain * mean_x)
