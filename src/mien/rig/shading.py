"""Eyes and teeth in the shadow of lids and lips ([Pighin 2002] sec. 5.2.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.head import SHADING

EYES, TEETH = "eyes", "teeth"
Polynomial = tuple[float, float, float]
"""c0 + c1 o + c2 o^2, the brightness at an opening o."""

MAX_OPENING = {EYES: 1.6, TEETH: 0.4}
"""Openings are clamped to this; beyond it brightness is constant."""
_PRIOR_SD = (0.15, 0.6, 0.6)
"""Prior standard deviation of the coefficients."""
_NOISE = 0.08
"""Standard deviation of a measured brightness ratio."""
_SCALE_SD = 0.01
_BRIGHTNESS_RANGE = (0.25, 1.5)


@dataclass(frozen=True)
class OpeningMeter:
    """Measures how far eyes and mouth are open, for one person.

    Attributes:
        lids: vertex pairs in the middle of the left and the right eye, (2, 2).
        lips: the pair in the middle of the mouth.
        corners: of the mouth.
        neutral: (2,) mm between the lids in neutral.
    """

    lids: tuple[tuple[int, int], tuple[int, int]]
    lips: tuple[int, int]
    corners: tuple[int, int]
    neutral: Float[Array, " 2"]

    @classmethod
    def of(cls, generic: GenericHead, vertices: Float[Array, "v 3"]) -> OpeningMeter:
        """For a person with these neutral vertices, (V, 3) mm."""
        lines = generic.polylines
        lids = tuple(
            (lines[f"{side}_upper_eyelid"][3], lines[f"{side}_lower_eyelid"][3])
            for side in ("left", "right")
        )
        lips = lines["upper_lip_inner"][3], lines["lower_lip_inner"][3]
        corners = lines["upper_lip_outer"][0], lines["upper_lip_outer"][-1]
        rest = np.maximum([_distance(vertices, pair) for pair in lids], 1.0)
        return cls((lids[0], lids[1]), lips, corners, rest)

    def measure(self, vertices: Float[Array, "v 3"]) -> Float[Array, " 3"]:
        """Of the left eye, the right eye and the mouth."""
        left, right = (_distance(vertices, pair) for pair in self.lids)
        mouth = _distance(vertices, self.lips) / max(_distance(vertices, self.corners), 1.0)
        return np.array([left / self.neutral[0], right / self.neutral[1], mouth])


def brightness_at(
    openings: Float[Array, "*n 3"], polynomials: Mapping[str, Polynomial]
) -> Float[Array, "*n 3"]:
    """Brightness of the left eye, the right eye and the teeth at these openings."""
    parts = (EYES, EYES, TEETH)
    c0, c1, c2 = np.array([polynomials[part] for part in parts]).T
    o = np.clip(openings, 0, [MAX_OPENING[part] for part in parts])
    return np.clip(c0 + o * (c1 + o * c2), *_BRIGHTNESS_RANGE)


def fit_polynomial(part: str, measured: Sequence[tuple[float, float, float]]) -> Polynomial:
    """The polynomial of highest posterior, given how bright photos show a part.

    Args:
        part: "eyes" or "teeth"; its default polynomial is the prior mean.
        measured: for each pair of photos the two openings and the ratio of the first brightness
            to the second.

    Source:
        [Pighin 2002] sec. 5.2.4; few photos do not determine three coefficients, hence the prior.
    """
    mean, spread = np.array(SHADING[part]), np.array(_PRIOR_SD)
    table = np.array(measured, float).reshape(-1, 3)
    at, other = (np.clip(table[:, k], 0, MAX_OPENING[part]) for k in (0, 1))
    # ratio = p(o) / p(other): linear in the coefficients once multiplied out.
    rows = at[:, None] ** np.arange(3) - table[:, 2:] * other[:, None] ** np.arange(3)
    # Ratios leave the scale undetermined: it is that of the prior mean at the largest opening.
    wide = MAX_OPENING[part] ** np.arange(3)
    normal = rows.T @ rows / _NOISE**2 + np.outer(wide, wide) / _SCALE_SD**2 + np.diag(spread**-2)
    right = mean / spread**2 + wide * (wide @ mean) / _SCALE_SD**2
    c0, c1, c2 = np.linalg.solve(normal, right).tolist()
    return c0, c1, c2


def _distance(vertices: Float[Array, "v 3"], pair: tuple[int, int]) -> float:
    return math.dist(vertices[pair[0]], vertices[pair[1]])
