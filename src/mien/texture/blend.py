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
from mien.texture.visibility import (
    MIN_CERTAINTY,
    TextureView,
    camera_parameters,
    project_point,
    surface_visibility,
)

# Certainties (cosines) between which a view's colours fade out: at 80 degrees and more a texel is
# smeared, at 70 degrees it is as sharp as its surroundings.
FADE = (MIN_CERTAINTY, 0.34)

# The feather between two photos is wide. Towards filled texels a photo's colours reach further:
# they have full confidence from a third of the ramp on.
_FULL_CONFIDENCE = 7 / 27


@dataclass(frozen=True)
class Blend:
    """The photos' colours on a surface.

    Attributes:
        colours: (H, W, 3) float32, 0 to 255; weighted mean of the photos, 0 where none shows it.
        coverage: (H, W) float32, the sum of the weights g_k.
        confidence: (H, W) float32 in [0, 1]; below 1 the colour is to be blended with the fill.
    """

    colours: Float[Array, "h w 3"]
    coverage: Float[Array, "h w"]
    confidence: Float[Array, "h w"]


def blend_views(
    surface: SurfaceMap,
    views: Sequence[TextureView],
    gains: Float[Array, "k 3"] | None = None,
    *,
    feather_mm: float,
    certainty_power: float = 1.0,
    fade: tuple[float, float] = FADE,
) -> Blend:
    """The convex combination of the photos on every texel ([Pighin 2002] sec. 5.2.1).

    Args:
        surface: the texels.
        views: K prepared photos.
        gains: (K, 3) factors on each photo's colours; 1 when None.
        feather_mm: as for visibility.surface_visibility.
        certainty_power: g_k = F_k P_k^power; 1 in the paper.
        fade: cosines between which a photo's colours fade out.
    """
    shape = surface.triangle_ids.shape
    colours = np.zeros((*shape, 3), np.float32)
    coverage, confidence = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for k, view in enumerate(views):
        visibility = surface_visibility(surface, view, feather_mm=feather_mm, min_certainty=fade[0])
        gain = np.ones(3) if gains is None else gains[k]
        arrays = (surface.points, visibility.feathered, visibility.certainty, view.photo)
        inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]
        inputs += [camera_parameters(view.camera), frozen(np.asarray(gain, np.float32))]

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
            certain = min(feathered[row, col] / _FULL_CONFIDENCE, 1.0)
            certain *= min(max((cosine - low) / (high - low), 0.0), 1.0)
            confidence[row, col] = max(confidence[row, col], certain)
            x, y, z = points[row, col]
            px, py, _ = project_point(pose, x, y, z)
            x0, x1, y0, y1, fx, fy = bilinear_neighbours(px, py, width, height)
            for c in range(3):
                above = (1.0 - fx) * photo[y0, x0, c] + fx * photo[y0, x1, c]
                below = (1.0 - fx) * photo[y1, x0, c] + fx * photo[y1, x1, c]
                value = (1.0 - fy) * above + fy * below
                colours[row, col, c] += weight * gain[c] * value
