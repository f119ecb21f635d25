"""What no photo shows: the other side of the face, then the surroundings."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.pyramid import fill_growing, fill_pyramid
from mien.numeric.sample import sample_bilinear
from mien.texture.blend import Blend
from mien.texture.cylinder import Cylinder
from mien.texture.surface import SurfaceMap

Fill = Literal["pyramid", "grow", "none"]
FILLS: tuple[Fill, ...] = ("pyramid", "grow", "none")


def fill_image(blend: Blend, fill: Fill, *, wrap: bool) -> Float[Array, "h w 3"]:
    """The colours with their holes filled, (H, W, 3) float32; half-certain ones are mixed in."""
    if fill == "grow":
        grown = fill_growing(blend.colours, blend.confidence > 0.5, wrap=wrap)
        return mix(blend.colours, grown, blend.confidence)
    return fill_pyramid(blend.colours, blend.confidence, wrap=wrap)


def mix(
    colours: Float[Array, "h w 3"], below: Float[Array, "*c"], confidence: Float[Array, "h w"]
) -> Float[Array, "h w 3"]:
    """Colours as far as they are certain, over what lies below (an image or one colour)."""
    mixed: Array = below + confidence[..., None] * (colours - below)
    return mixed.astype(np.float32)


def over(blend: Blend, below: Blend) -> Blend:
    """One blend over another: where the first is not certain, the second shows through."""
    share = (1 - blend.confidence) * below.confidence
    confidence = blend.confidence + share
    upper = (blend.confidence / np.maximum(confidence, 1e-12))[..., None]
    colours = below.colours + upper * (blend.colours - below.colours)
    return Blend(colours.astype(np.float32), blend.coverage, confidence.astype(np.float32))


def from_cylinder(
    image: Float[Array, "h w 3"], cylinder: Cylinder, surface: SurfaceMap, texels: Array
) -> Float[Array, "n 3"]:
    """Colours of chosen texels (boolean mask) from an image on the cylinder around them.

    The cylinder has no seams but at the back, where it wraps: a fill that is made on it is smooth
    across every seam between charts.
    """
    height, width = image.shape[:2]
    uvs = cylinder.uvs(surface.points[texels].astype(np.float64))
    padded = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
    places = np.column_stack([uvs[:, 0] * width + 1, (1 - uvs[:, 1]) * height])
    return sample_bilinear(padded, places)
