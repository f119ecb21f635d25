"""How each part of the head gets its colours: from which photos, and what where none shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mien.arrays import Array, Float
from mien.texture.blend import Blend


@dataclass(frozen=True)
class PartStyle:
    """How a part is textured.

    Attributes:
        photos: "blend" all of them, take the "best" one (P02 sec. 5.2.4: the parts that move or
            are half hidden come from one photo, where they are clearly seen), or "none".
        fill: what no photo shows is continued from the "surface" around it, takes the "white" of
            what is seen, or the "default" colour.
        default: 8-bit sRGB, where photos say nothing.
        feather_mm: at most; small parts need narrow ramps.
    """

    photos: Literal["blend", "best", "none"]
    fill: Literal["surface", "white", "default"]
    default: tuple[int, int, int]
    feather_mm: float = np.inf


SKIN = PartStyle("blend", "surface", (176, 138, 118))
_EYEBALL = PartStyle("best", "white", (214, 205, 198), feather_mm=1.0)
_TEETH = PartStyle("best", "default", (206, 196, 178), feather_mm=1.0)

# The defaults are plain: sclera, enamel, mucosa and lashes as photographs usually show them.
STYLES = {
    "skin": SKIN,
    "left_eyeball": _EYEBALL,
    "right_eyeball": _EYEBALL,
    "upper_teeth": _TEETH,
    "lower_teeth": _TEETH,
    "tongue": PartStyle("best", "default", (150, 82, 80), feather_mm=1.0),
    "lashes": PartStyle("none", "default", (38, 30, 26)),
    "hair": PartStyle("blend", "surface", (60, 48, 40)),
}

# Regions of the skin (soft masks by name) whose holes are filled from the region itself: hair must
# not run into the neck, nor an ear's pink into the hair behind it.
FILLED_ALONE = ("left_ear", "right_ear", "scalp", "neck")

# Regions of the skin that photos of a closed mouth do not show, and their plain colours.
REGION_COLOURS = {"mouth_cavity": (92, 40, 40)}

# Parts that are so thin or so loosely modelled that they must not hide what is behind them.
SEE_THROUGH = ("lashes", "hair")


def fill_colour(style: PartStyle, blend: Blend) -> Float[Array, " 3"]:
    """The one colour (0 to 255) of a part where no photo shows it."""
    if style.fill == "white":
        return _white(blend, np.asarray(style.default, float))
    return np.asarray(style.default, float)


def _white(blend: Blend, default: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """The tone of an eye's white: what is bright and grey among the colours that are seen."""
    seen = blend.colours[blend.confidence > 0.5]
    if len(seen) < 50:
        return default
    brightness, spread = seen.mean(axis=1), np.ptp(seen, axis=1)
    # Lids and lashes at the rim are dark or reddish, the iris is dark, the glint is the brightest.
    low, high = np.percentile(brightness, [60, 90])
    chosen = (brightness >= low) & (brightness <= high) & (spread <= np.median(spread) + 1)
    white: Array = np.median(seen[chosen], axis=0) if chosen.any() else default
    return white
