"""The face drawn for comparison: every expression's picture, pixel by pixel (P02 eq. 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Bool, Float, Int
from mien.expressions.state import PosedFace
from mien.numeric.raster import Raster, rasterize
from mien.numeric.threads import for_row_bands
from mien.render.mipmap import Four, Pyramids, level_of_detail, place_lookup, weighted_texels
from mien.render.mix import Painted
from mien.track.grey import GreyPyramids, add_greys
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
        layers: (h, w, K) float32, 0 to 255: luma of each expression's rendering, on one geometry.
        luma: (h, w) float32: of their mixture, P02 eq. (5).
    """

    ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    depth: Float[Array, "h w"]
    places: Float[Array, "v 3"]
    mask: Float[Array, "h w"]
    layers: Float[Array, "h w k"]
    luma: Float[Array, "h w"]


def draw(
    painted: Painted,
    grey: GreyPyramids,
    compared: Bool[Array, " f"],
    face: PosedFace,
    pose: Pose,
    view: View,
    *,
    layers: bool = True,
) -> Drawing:
    """The face as the view sees it, in shades of grey.

    Args:
        grey: of the painted textures.
        layers: keep every expression's rendering; otherwise there are 0 of them.
    """
    places, ids, raster, shades = _placed(painted, face, pose, view)
    height, width = ids.shape
    count = face.weights.shape[1] if layers else 0
    out, luma = np.zeros((height, width, count), np.float32), np.zeros((height, width), np.float32)
    mask = np.empty((height, width), np.float32)
    surface = (compared, painted.triangles, painted.uvs, grey, shades)

    def rows(first: int, end: int) -> None:
        _shade_rows(ids, raster.barycentrics, *surface, first, end, mask, out, luma)

    for_row_bands(rows, height, work=2 * width * height)
    return Drawing(ids, raster.barycentrics, raster.depth, places, mask, out, luma)


def draw_colours(
    painted: Painted, compared: Bool[Array, " f"], face: PosedFace, pose: Pose, view: View
) -> tuple[Float[Array, "h w 3"], Float[Array, "h w"]]:
    """The mixture in colour, 0 to 255, and where it is one of the compared triangles."""
    _, ids, raster, shades = _placed(painted, face, pose, view)
    height, width = ids.shape
    out, mask = np.zeros((height, width, 3), np.float32), np.empty((height, width), np.float32)
    surface = (compared, painted.triangles, painted.uvs, painted.pyramids, shades)
    _colour_rows(ids, raster.barycentrics, *surface, mask, out)
    return out, mask


def _placed(
    painted: Painted, face: PosedFace, pose: Pose, view: View
) -> tuple[Float[Array, "v 3"], Int[Array, "h w"], Raster, Float[Array, "v s"]]:
    """Vertices in camera space, what covers the pixels, and detail, brightness and weights."""
    width, height = view.size
    focal = view.focal * pose.zoom
    places = face.vertices @ pose.R.T + pose.t
    points = focal * places[:, :2] / places[:, 2:] + (view.cx, view.cy)
    raster = rasterize(points, places[:, 2], painted.triangles, width, height, cull=True)
    shades = np.empty((len(points), 2 + face.weights.shape[1]), np.float32)
    # As sharp as a picture of four samples a pixel (render.mix).
    shades[:, 0] = level_of_detail(painted.texels, points, painted.triangles) - 0.5
    shades[:, 1], shades[:, 2:] = face.brightness, face.weights
    return places, raster.triangle_ids, raster, shades


@njit(inline="always")
def _lookup(
    t: int,
    b: tuple[float, float, float],
    triangles: Array,
    uvs: Array,
    pyramids: Pyramids | GreyPyramids,
    shades: Array,
    dropped: int,
) -> tuple[Four, Four, float]:
    """Texels and their weights for a place in a triangle, and its brightness."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    u = b[0] * uvs[t, 0, 0] + b[1] * uvs[t, 1, 0] + b[2] * uvs[t, 2, 0]
    v = b[0] * uvs[t, 0, 1] + b[1] * uvs[t, 1, 1] + b[2] * uvs[t, 2, 1]
    level = b[0] * shades[i, 0] + b[1] * shades[j, 0] + b[2] * shades[k, 0]
    bright = b[0] * shades[i, 1] + b[1] * shades[j, 1] + b[2] * shades[k, 1]
    fine, coarse = place_lookup(pyramids, u, v, level - dropped)
    return fine, coarse, bright


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _shade_rows(
    ids: Array,
    barycentrics: Array,
    compared: Array,
    triangles: Array,
    uvs: Array,
    grey: GreyPyramids,
    shades: Array,
    first: int,
    end: int,
    mask: Array,
    out: Array,
    luma: Array,
) -> None:
    """Fill in mask, layers and luma; ids that are not compared become -1."""
    dropped = grey.dropped
    greys = np.empty(grey.texels.shape[1], np.float32)
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0 or not compared[t]:
                ids[row, col] = -1
                mask[row, col] = 0.0
                continue
            mask[row, col] = 1.0
            b0 = barycentrics[row, col, 0]
            b1 = barycentrics[row, col, 1]
            b2 = barycentrics[row, col, 2]
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b = (b0, b1, b2)
            fine, coarse, bright = _lookup(t, b, triangles, uvs, grey, shades, dropped)
            add_greys(grey.texels, fine, coarse, greys)
            total = np.float32(0.0)
            for n in range(len(greys)):
                c = 2 + n
                weight = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
                total += weight * greys[n]
            for n in range(out.shape[2]):
                out[row, col, n] = bright * greys[n]
            luma[row, col] = bright * total


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _colour_rows(
    ids: Array,
    barycentrics: Array,
    compared: Array,
    triangles: Array,
    uvs: Array,
    pyramids: Pyramids,
    shades: Array,
    mask: Array,
    out: Array,
) -> None:
    for row in range(len(ids)):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            mask[row, col] = 0.0
            if t < 0 or not compared[t]:
                continue
            mask[row, col] = 1.0
            b0 = barycentrics[row, col, 0]
            b1 = barycentrics[row, col, 1]
            b2 = barycentrics[row, col, 2]
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b = (b0, b1, b2)
            fine, coarse, bright = _lookup(t, b, triangles, uvs, pyramids, shades, 0)
            for n in range(shades.shape[1] - 2):
                c = 2 + n
                weight = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
                if weight != 0.0:
                    red, green, blue = weighted_texels(pyramids.texels, n, fine, coarse)
                    out[row, col, 0] += bright * weight * red
                    out[row, col, 1] += bright * weight * green
                    out[row, col, 2] += bright * weight * blue
