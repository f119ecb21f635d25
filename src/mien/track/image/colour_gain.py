"""Gain and bias between the colours of a frame and those of the drawn face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mien.arrays import Array, Float
from mien.track.image.greyscale import LUMA

_GAIN_SD = 0.3
"""Standard deviation of a camera's gain around 1."""
_EFFECTIVE_OBSERVATIONS = 200.0
"""How many independent observations a face's pixels are worth."""


@dataclass(frozen=True)
class ColourGain:
    """A frame's colours from the drawn ones: frame = gain * drawn + bias, 0 to 255.

    Attributes:
        gain: (3,).
        bias: (3,).
    """

    gain: Float[Array, " 3"] = field(default_factory=lambda: np.ones(3))
    bias: Float[Array, " 3"] = field(default_factory=lambda: np.zeros(3))

    def towards(self, other: ColourGain, fraction: float) -> ColourGain:
        """Linear interpolation: 0 is this one, 1 the other."""
        gain = self.gain + fraction * (other.gain - self.gain)
        return ColourGain(gain, self.bias + fraction * (other.bias - self.bias))

    def applied(self, drawn: Float[Array, "h w 3"]) -> Float[Array, "h w 3"]:
        """A drawn picture in the frame's colours."""
        return np.asarray(drawn * self.gain + self.bias, np.float32)

    def corrected_luma(self, pixels: Float[Array, "h w 3"]) -> Float[Array, "h w"]:
        """Luma of a frame in the colours of the drawn picture."""
        import cv2

        coefficients = np.array(LUMA) / self.gain
        constant = float(coefficients @ self.bias)
        luma = cv2.transform(pixels, np.array([[*coefficients, -constant]]))
        return np.asarray(luma, np.float32)


def estimate_colour_gain(
    drawn: Float[Array, "h w 3"], target: Float[Array, "h w 3"], weights: Float[Array, "h w"]
) -> ColourGain:
    """Gain and bias by weighted least squares, with a prior that gains are near 1.

    Without the prior a face of little contrast would not determine both.

    Args:
        drawn: 0 to 255.
        target: of the frame, 0 to 255.
        weights: of the pixels.
    """
    chosen = weights > 0
    if not chosen.any():
        return ColourGain()
    w = weights[chosen].astype(np.float64)
    x, y = drawn[chosen].astype(np.float64), target[chosen].astype(np.float64)
    total = max(float(w.sum()), 1e-9)
    mean_x, mean_y = w @ x / total, w @ y / total
    dx, dy = x - mean_x, y - mean_y
    variance = np.maximum(w @ (dx * dx), 1e-9)
    noise = np.maximum(w @ (dy - dx) ** 2 / total, 1.0)
    prior = noise / _GAIN_SD**2 * total / _EFFECTIVE_OBSERVATIONS
    gain = (w @ (dx * dy) + prior) / (variance + prior)
    gain = np.clip(gain, 0.2, 5.0)
    return ColourGain(gain, mean_y - gain * mean_x)
