"""Photos blended on a surface, each weighted by g_k = F_k P_k."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.numeric.images.sampling import bilinear_neighbours
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.texture.surface import SurfaceMap
from mien.texture.visibility import LEAST_CERTAINTY, View, camera_numbers, project_point, sight

# Certainties (cosines) between which a view's colours fade out: a texel that is seen at 80
# degrees or more is a smear, at 70 degrees it is as good as its surroundings.
FADE = (LEAST_CERTAINTY, 0.34)

# The feather blends one photo into another and is wide. Towards what is only filled a photo's
# colours reach further: they stand by themselves from a third of the ramp on.
_ALONE = 7 / 27


@dataclass(frozen=True)
class Blend:
    """The photos' colours on a surface.

    Attributes:
        colours: (H, W, 3) float32, 0 to 255; the weighted mean of the photos, zero where none sees.
        coverage: (H, W) float32, the sum of the weights g_k.
        confidence: (H, W) float32 in [0, 1]: how far the colour may stand by itself; below 1 it is
            to be mixed with what fills the holes.
    """

    colours: Float[Array, "h w 3"]
    coverage: Float[Array, "h w"]
    confidence: Float[Array, "h w"]


def blend_views(
    surface: SurfaceMap,
    views: Sequence[View],
    gains: Float[Array, "k 3"] | None = None,
    *,
    feather_mm: float,
    certainty_power: float = 1.0,
    fade: tuple[float, float] = FADE,
) -> Blend:
    """The convex combination of the photos on every texel ([Pighin 2002] sec. 5.2.1).

    Args:
        gains: (K, 3) factors on each photo's colours; 1 when None.
        feather_mm: as for visibility.sight.
        certainty_power: g_k = F_k P_k^power; 1 in the paper.
        fade: cosines between which a photo's colours fade out.
    """
    shape = surface.triangle_ids.shape
    colours = np.zeros((*shape, 3), np.float32)
    coverage, confidence = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for k, view in enumerate(views):
        seen = sight(surface, view, feather_mm=feather_mm, least_certainty=fade[0])
        gain = np.ones(3) if gains is None else gains[k]
        arrays = (surface.points, seen.feathered, seen.certainty, view.photo)
        inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]
        inputs += [camera_numbers(view.camera), frozen(np.asarray(gain, np.float32))]

        def rows(first: int, end: int, inputs: list[Array] = inputs) -> None:
            _add_rows(*inputs, certainty_power, *fade, first, end, colours, coverage, confidence)

        for_row_bands(rows, shape[0], work=coverage.size)
    colours /= np.maximum(coverage, 1e-12)[..., None]
    return Blend(colours, coverage, confidence)


@njit(cache=True, nogil=True)
def _add_rows(
    points: Array,
    feathered: Array,
    certainty: Array,
    photo: Array,
    pose: Array,
    gain: Array,
    power: float,
    low: float,
    high: float,
    first: int,
    end: int,
    colours: Array,
    coverage: Array,
    confidence: Array,
) -> None:
    """Add one photo, weighted by g_k, to the sums."""
    height, width = photo.shape[:2]
    for row in range(first, end):
        for col in range(coverage.shape[1]):
            if feathered[row, col] <= 0.0:
                continue
            cosine = certainty[row, col]
            weight = feathered[row, col] * (cosine if power == 1.0 else cosine**power)
            coverage[row, col] += weight
            alone = min(feathered[row, col] / _ALONE, 1.0)
            alone *= min(max((cosine - low) / (high - low), 0.0), 1.0)
            confidence[row, col] = max(confidence[row, col], alone)
            x, y, z = points[row, col]
            px, py, _ = project_point(pose, x, y, z)
            x0, x1, y0, y1, fx, fy = bilinear_neighbours(px, py, width, height)
            for c in range(3):
                above = (1.0 - fx) * photo[y0, x0, c] + fx * photo[y0, x1, c]
                below = (1.0 - fx) * photo[y1, x0, c] + fx * photo[y1, x1, c]
                value = (1.0 - fy) * above + fy * below
                colours[row, col, c] += weight * gain[c] * value
