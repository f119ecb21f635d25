"""How each part of the head is coloured: from which photos, and how its holes are filled."""

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
        photos: "blend" all of them; use the "best" one, and the others only where it shows nothing
            ([Pighin 2002] sec. 5.2.4: what moves or is half hidden comes from one photo); or
            "none".
        fill: holes are filled from the "surface" around them, with the "white" of the visible
            texels, or with the "default" colour.
        default: 8-bit sRGB.
        feather_mm: upper limit; small parts need narrow ramps.
        reach_mm: how far visible colours extend into a fill of one colour.
    """

    photos: Literal["blend", "best", "none"]
    fill: Literal["surface", "white", "default"]
    default: tuple[int, int, int]
    feather_mm: float = np.inf
    reach_mm: float = 0.0


SKIN = PartStyle("blend", "surface", (176, 138, 118))
_EYEBALL = PartStyle("best", "white", (196, 186, 178), feather_mm=1.0, reach_mm=3.0)
_TEETH = PartStyle("best", "default", (74, 67, 60), feather_mm=1.0)

# The defaults are plain: sclera, mucosa and lashes as photographs usually show them. Teeth and
# tongue that no photo shows are behind closed lips: they get enamel and mucosa in deep shadow, for
# [Pighin 2002] darkens them with the mouth's opening (sec. 5.2.4) and white ones would gleam
# through the slightest gap between the lips.
STYLES = {
    "skin": SKIN,
    "left_eyeball": _EYEBALL,
    "right_eyeball": _EYEBALL,
    "upper_teeth": _TEETH,
    "lower_teeth": _TEETH,
    "tongue": PartStyle("best", "default", (72, 36, 33), feather_mm=1.0),
    "lashes": PartStyle("none", "default", (38, 30, 26)),
    "hair": PartStyle("blend", "surface", (60, 48, 40)),
}

# Regions of the skin (soft masks by name) whose holes are filled from the region itself: hair must
# not run into the neck, nor an ear's pink into the hair behind it. EARS stand out from the head, so
# that what lies around them on the cylinder does not lie beside them.
EARS = ("left_ear", "right_ear")
FILLED_ALONE = (*EARS, "scalp", "neck")

# Regions of the skin that photos do not show (inside of mouth and nostrils), and their colours.
REGION_COLOURS = {"mouth_cavity": (58, 26, 24)}

# Parts that are so thin or so loosely modelled that they must not hide what is behind them.
SEE_THROUGH = ("lashes", "hair")


def fill_colour(style: PartStyle, blend: Blend) -> Float[Array, " 3"]:
    """The one colour (0 to 255) of a part where no photo shows it."""
    if style.fill == "white":
        return _white(blend, np.asarray(style.default, float))
    return np.asarray(style.default, float)


def _white(blend: Blend, default: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Colour of the sclera: the bright and grey ones of the visible colours."""
    visible = blend.colours[blend.confidence > 0.5]
    if len(visible) < 50:
        return default
    brightness, spread = visible.mean(axis=1), np.ptp(visible, axis=1)
    # Lids and lashes at the rim are dark or reddish, the iris is dark, the glint is the brightest.
    low, high = np.percentile(brightness, [60, 90])
    chosen = (brightness >= low) & (brightness <= high) & (spread <= np.median(spread) + 1)
    if not chosen.any():
        return default
    tone = np.median(visible[chosen], axis=0)
    # Some of it may still be skin of a lid: keep the brightness, but only half of the hue.
    return (tone + default * (tone.mean() / default.mean())) / 2
