"""Gains that equalize exposure and white balance between photos."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.texture.blend import blend_views
from mien.texture.surface import SurfaceMap
from mien.texture.visibility import TextureView

# Colours outside this range (of 255) are unreliable: dark ones are noisy, bright ones clipped.
_RANGE = (16, 245)
_MIN_TEXELS = 50


def estimate_gains(
    surface: SurfaceMap,
    views: Sequence[TextureView],
    *,
    feather_mm: float = 12.0,
    certainty_power: float = 1.0,
) -> Float[Array, "k 3"]:
    """(K, 3) factors on each photo's colours that make photos agree where they overlap.

    Args:
        surface: where photos are compared; a coarse map suffices.
        views: K prepared photos.
        feather_mm: as for surface_visibility.
        certainty_power: as for blend_views.

    The logarithms of the factors are a least-squares fit to the median log ratios of all
    overlapping pairs, weighted by the overlap.

    Returns:
        factors whose product over the photos is 1 in each channel; 1 for a photo that overlaps with
        no other.
    """
    samples = [_samples(surface, view, feather_mm, certainty_power) for view in views]
    count = len(views)
    rows, targets = [], []
    for j in range(count):
        for k in range(j):
            weight = np.minimum(samples[j][1], samples[k][1])
            both = weight > 0.2
            if both.sum() < _MIN_TEXELS:
                continue
            ratio = np.median(np.log(samples[j][0][both] / samples[k][0][both]), axis=0)
            strength = np.sqrt(float(both.sum()))
            row = np.zeros(count)
            row[j], row[k] = -strength, strength
            rows.append(row)
            targets.append(strength * ratio)
    if not rows:
        return np.ones((count, 3))
    # Of all solutions the one of least norm: its mean over photos that overlap is zero.
    logs, *_ = np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)
    return np.exp(logs)


def _samples(
    surface: SurfaceMap, view: TextureView, feather_mm: float, power: float
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """Colours and weights on the texels of the surface; weight 0 where they are unreliable."""
    blend = blend_views(surface, [view], feather_mm=feather_mm, certainty_power=power)
    low, high = _RANGE
    useful = (blend.colours.min(axis=2) > low) & (blend.colours.max(axis=2) < high)
    weights = np.where(useful, blend.coverage, 0)
    return np.maximum(blend.colours, 1).reshape(-1, 3), weights.reshape(-1)
