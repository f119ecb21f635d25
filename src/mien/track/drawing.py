"""The face drawn for comparison: every expression's picture, pixel by pixel (P02 eq. 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Bool, Float, Int
from mien.expressions.state import PosedFace
from mien.numeric.raster import rasterize
from mien.numeric.threads import for_row_bands
from mien.render.mipmap import Pyramids, level_of_detail, place_lookup, weighted_texels
from mien.render.mix import Painted
from mien.track.views import View


@dataclass(frozen=True)
class Pose:
    """Where the head is.

    Attributes:
        R: (3, 3) R_cam_head. t: (3,) mm, t_cam_head.
        zoom: the lens's focal length over that of the views.
    """

    R: Float[Array, "3 3"]
    t: Float[Array, " 3"]
    zoom: float = 1.0


class Drawing(NamedTuple):
    """What a view shows of the model.

    Attributes:
        ids: (h, w) triangles, -1 where there is none that is compared.
        barycentrics: (h, w, 3). depth: (h, w) mm.
        places: (V, 3) mm, camera space.
        mask: (h, w) float32, 1 where there is a triangle that is compared.
        layers: (h, w, K, 3) float32, 0 to 255: each expression's rendering, on one geometry.
        weights: (V, K) of the mixture.
    """

    ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    depth: Float[Array, "h w"]
    places: Float[Array, "v 3"]
    mask: Float[Array, "h w"]
    layers: Float[Array, "h w k 3"]
    weights: Float[Array, "v k"]


def draw(
    painted: Painted,
    compared: Bool[Array, " f"],
    face: PosedFace,
    pose: Pose,
    view: View,
    *,
    layers: bool,
) -> Drawing:
    """The face as the view sees it.

    Args:
        layers: keep every expression's rendering apart; otherwise their mixture alone, as one.
    """
    width, height = view.size
    focal = view.focal * pose.zoom
    places = face.vertices @ pose.R.T + pose.t
    points = focal * places[:, :2] / places[:, 2:] + (view.cx, view.cy)
    raster = rasterize(points, places[:, 2], painted.triangles, width, height, cull=True)
    # As sharp as a picture of four samples a pixel (render.mix).
    detail = level_of_detail(painted.texels, points, painted.triangles) - 0.5
    shades = np.column_stack([detail, face.brightness, face.weights]).astype(np.float32)
    count = face.weights.shape[1] if layers else 1
    out = np.zeros((height, width, count, 3), np.float32)
    mask = np.empty((height, width), np.float32)
    ids = raster.triangle_ids

    def rows(first: int, end: int) -> None:
        _shade_rows(
            ids,
            raster.barycentrics,
            compared,
            painted.triangles,
            painted.uvs,
            painted.pyramids,
            shades,
            layers,
            first,
            end,
            mask,
            out,
        )

    for_row_bands(rows, height, work=8 * width * height)
    weights = shades[:, 2:] if layers else np.ones((len(shades), 1), np.float32)
    return Drawing(ids, raster.barycentrics, raster.depth, places, mask, out, weights)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _shade_rows(
    ids: Array,
    barycentrics: Array,
    compared: Array,
    triangles: Array,
    uvs: Array,
    pyramids: Pyramids,
    shades: Array,
    apart: bool,
    first: int,
    end: int,
    mask: Array,
    out: Array,
) -> None:
    """Fill in mask and out; ids that are not compared become -1."""
    count = shades.shape[1] - 2
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0 or not compared[t]:
                ids[row, col] = -1
                mask[row, col] = 0.0
                continue
            mask[row, col] = 1.0
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b0 = barycentrics[row, col, 0]
            b1 = barycentrics[row, col, 1]
            b2 = barycentrics[row, col, 2]
            u = b0 * uvs[t, 0, 0] + b1 * uvs[t, 1, 0] + b2 * uvs[t, 2, 0]
            v = b0 * uvs[t, 0, 1] + b1 * uvs[t, 1, 1] + b2 * uvs[t, 2, 1]
            level = b0 * shades[i, 0] + b1 * shades[j, 0] + b2 * shades[k, 0]
            bright = b0 * shades[i, 1] + b1 * shades[j, 1] + b2 * shades[k, 1]
            fine, coarse = place_lookup(pyramids, u, v, level)
            for n in range(count):
                weight = 1.0
                if not apart:
                    c = 2 + n
                    weight = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
                    if weight == 0.0:
                        continue
                red, green, blue = weighted_texels(pyramids.texels, n, fine, coarse)
                place = n if apart else 0
                out[row, col, place, 0] += bright * weight * red
                out[row, col, place, 1] += bright * weight * green
                out[row, col, place, 2] += bright * weight * blue
