"""Another camera's colours, and pixels that show something else than the face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mien.arrays import Array, Float
from mien.track.bands import odd
from mien.track.drawing import LUMA

_GAIN_SD = 0.3
_LIKE_PIXELS = 200.0
"""How many pixels' worth the belief weighs that a gain is 1 to within its deviation."""
_LEAST_SCALE = 12.0
"""Grey levels: the drawn face is never expected to be nearer to the frame than this."""
_OUTLYING = 2.5
"""Times the usual difference at which a pixel's weight is down to a quarter."""
_PATCH = 0.1
"""Width over which differences are averaged, over the face's: what covers a face is no speck."""


@dataclass(frozen=True)
class Colours:
    """How a frame's colours come from the drawn ones: frame = gain * drawn + bias, 0 to 255.

    Attributes:
        gain, bias: (3,).
    """

    gain: Float[Array, " 3"] = field(default_factory=lambda: np.ones(3))
    bias: Float[Array, " 3"] = field(default_factory=lambda: np.zeros(3))

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
    w = weights[chosen].astype(np.float64)
    x, y = drawn[chosen].astype(np.float64), target[chosen].astype(np.float64)
    total = max(float(w.sum()), 1e-9)
    mean_x, mean_y = w @ x / total, w @ y / total
    dx, dy = x - mean_x, y - mean_y
    variance = np.maximum(w @ (dx * dx), 1e-9)
    noise = np.maximum(w @ (dy - dx) ** 2 / total, 1.0)
    belief = np.minimum(noise / _GAIN_SD**2, variance) * _LIKE_PIXELS / total
    gain = (w @ (dx * dy) + belief) / (variance + belief)
    gain = np.clip(gain, 0.2, 5.0)
    return Colours(gain, mean_y - gain * mean_x)


def pixel_weights(
    drawn: Float[Array, "h w 3"],
    target: Float[Array, "h w 3"],
    mask: Float[Array, "h w"],
    *,
    face_px: float,
) -> Float[Array, "h w"]:
    """(h, w) float32 from 0 to 1: 0 outside of the mask, and low where the two differ too much.

    Geman and McClure's weights, of differences averaged over patches.
    """
    import cv2

    squares = ((target - drawn) ** 2).mean(axis=2) * (mask > 0)
    width = odd(_PATCH * face_px)
    around = cv2.blur(squares, (width, width), borderType=cv2.BORDER_CONSTANT)
    shares = cv2.blur(mask, (width, width), borderType=cv2.BORDER_CONSTANT)
    inside = mask > 0
    if not inside.any():
        return np.zeros_like(mask)
    around = around / np.maximum(shares, 1e-6)
    scale = max(float(np.median(around[inside])), _LEAST_SCALE**2) * _OUTLYING**2
    return np.asarray(mask / (1 + around / scale) ** 2, np.float32)


def usual_difference(
    drawn: Float[Array, "h w 3"], target: Float[Array, "h w 3"], weights: Float[Array, "h w"]
) -> float:
    """Grey levels by which a pixel may be off and still count: three times the median's worth."""
    squares = ((target - drawn) ** 2).mean(axis=2)[weights > 0.25]
    median = float(np.median(squares)) if squares.size else 0.0
    # The median of squares of a normal error is 0.455 of their mean.
    return max(3.0 * np.sqrt(median / 0.455), _LEAST_SCALE)
