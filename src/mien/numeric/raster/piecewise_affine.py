"""Piecewise-affine warps: the pixels of each triangle, and their places in other pictures."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.errors import InputError
from mien.numeric.kernels.jit import njit
from mien.numeric.raster.rasterizer import check_triangles

__all__ = [
    "SUBPIXELS",
    "affine_maps",
    "orient_triangles",
    "row_extents",
    "scanline_spans",
    "to_subpixels",
]

SUBPIXELS = 1024
"""Parts of a pixel at which corners are drawn: sums are exact, no pixel is lost or shared."""

_FARTHEST = 1 << 18
"""px. Corners farther off are clamped to it, so that products of differences fit 64 bits."""


def to_subpixels(points: Float[Array, "n 2"]) -> Int[Array, "n 2"]:
    """(n, 2) int64, in parts of a pixel, of (n, 2) px. Raises: InputError: shape, NaN."""
    points = check_array("points", points, (None, 2))
    near = np.clip(points, -_FARTHEST, _FARTHEST)
    return frozen(np.round(near * SUBPIXELS).astype(np.int64))


def orient_triangles(
    triangles: Int[Array, "t 3"], points: Float[Array, "n 2"]
) -> Int[Array, "t 3"]:
    """The triangles, all of the orientation that is drawn, for points as given.

    Where the points are moved later, triangles that fold over are not drawn. While the mesh's
    border stays, its inside stays covered.

    Raises:
        InputError: shapes, NaN, an index out of range, a triangle without area.
    """
    points = check_array("points", points, (None, 2))
    turned = check_triangles(triangles, len(points)).copy()
    corners = points[turned]
    (bx, by), (cx, cy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    areas = bx * cy - by * cx
    if (areas == 0).any():
        raise InputError("triangles", "none without area", f"{int(np.argmin(np.abs(areas)))}")
    turned[areas < 0] = turned[areas < 0][:, [0, 2, 1]]
    return frozen(np.ascontiguousarray(turned, np.int32))


@njit(cache=True, nogil=True, error_model="numpy")
def affine_maps(corners: Array, triangles: Array, pictures: Array) -> Array:
    """Affine maps from the pixels of each triangle to other pictures.

    Args:
        corners: (n, 2) in parts of a pixel, of the picture that is drawn.
        triangles: (T, 3) oriented by `orient_triangles`.
        pictures: (m, n, 2) px, the same points in each of the others.

    Returns:
        (T, m, 6): x at the pixel that holds the first corner, counted from the centre of the
        picture's first pixel, its change by column and by row; the same of y. Undefined for
        triangles that are not drawn.
    """
    maps = np.empty((len(triangles), len(pictures), 6))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        x, y = corners[a, 0], corners[a, 1]
        bx, by = corners[b, 0] - x, corners[b, 1] - y
        cx, cy = corners[c, 0] - x, corners[c, 1] - y
        area = bx * cy - by * cx
        if area <= 0:
            continue
        scale = SUBPIXELS / area
        # From the first corner to the centre of the pixel that it lies in, px.
        right = 0.5 - (x % SUBPIXELS) / SUBPIXELS
        down = 0.5 - (y % SUBPIXELS) / SUBPIXELS
        for i in range(len(pictures)):
            for axis in range(2):
                start = pictures[i, a, axis]
                u, v = pictures[i, b, axis] - start, pictures[i, c, axis] - start
                by_col, by_row = (u * cy - v * by) * scale, (v * bx - u * cx) * scale
                maps[t, i, 3 * axis] = start - 0.5 + by_col * right + by_row * down
                maps[t, i, 3 * axis + 1] = by_col
                maps[t, i, 3 * axis + 2] = by_row
    return maps


@njit(cache=True, nogil=True, error_model="numpy")
def row_extents(corners: Array, triangles: Array) -> tuple[Array, Array]:
    """(T,) first row and end of each triangle, in the picture or not; none if folded over."""
    tops, ends = np.zeros(len(triangles), np.int64), np.zeros(len(triangles), np.int64)
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay = corners[a, 0], corners[a, 1]
        bx, by, cx, cy = corners[b, 0], corners[b, 1], corners[c, 0], corners[c, 1]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0:
            tops[t], ends[t] = min(ay, by, cy) // SUBPIXELS, max(ay, by, cy) // SUBPIXELS + 1
    return tops, ends


@njit(cache=True, nogil=True, error_model="numpy")
def scanline_spans(
    corners: Array,
    triangles: Array,
    tops: Array,
    ends: Array,
    row: int,
    width: int,
    found: Array,
    starts: Array,
    spans: Array,
) -> int:
    """Spans of triangles along a row of a picture.

    Where several cover a pixel, as beside a fold, the one whose span begins first has it.

    Args:
        corners: (n, 2) in parts of a pixel.
        triangles: (T, 3) oriented by `orient_triangles`.
        tops: of `row_extents`.
        ends: of `row_extents`.
        row: of the picture.
        width: of the picture.
        found: (T, 3) working memory.
        starts: (2 T + 2,) filled with the spans' first columns and, after them, the width.
        spans: (2 T + 1,) filled with their triangles, -1 where there is none.

    Returns:
        how many spans.
    """
    size = 0
    for t in range(len(triangles)):
        if tops[t] <= row < ends[t]:
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            first, end = _triangle_span(corners, a, b, c, row, width)
            if first < end:
                n = size
                while n > 0 and found[n - 1, 0] > first:
                    found[n] = found[n - 1]
                    n -= 1
                found[n, 0], found[n, 1], found[n, 2] = first, end, t
                size += 1
    count, col = 0, 0
    for n in range(size):
        first, end, t = found[n, 0], found[n, 1], found[n, 2]
        if first > col:
            starts[count], spans[count] = col, -1
            count, col = count + 1, first
        if end > col:
            starts[count], spans[count] = col, t
            count, col = count + 1, end
    if col < width:
        starts[count], spans[count] = col, -1
        count += 1
    starts[count] = width
    return count


@njit(inline="always")
def _triangle_span(corners: Array, a: int, b: int, c: int, row: int, width: int) -> tuple[int, int]:
    """First column and end of a facing triangle's pixels in a row of a picture.

    A pixel belongs to the triangle that holds its centre; on an edge, to the one below it or right
    of it (top-left rule). So triangles that share edges leave no gap and do not overlap.
    """
    first, end = _clip_to_edge(corners, a, b, row, 0, width)
    first, end = _clip_to_edge(corners, b, c, row, first, end)
    first, end = _clip_to_edge(corners, c, a, row, first, end)
    return first, end


@njit(inline="always")
def _clip_to_edge(
    corners: Array, a: int, b: int, row: int, first: int, end: int
) -> tuple[int, int]:
    """The part of a row from first to end on the inner side of the edge from a to b."""
    dx, dy = corners[b, 0] - corners[a, 0], corners[b, 1] - corners[a, 1]
    below = row * SUBPIXELS + SUBPIXELS // 2 - corners[a, 1]
    right = SUBPIXELS // 2 - corners[a, 0]
    # A pixel is inside where inner - dy * SUBPIXELS * column is not negative.
    inner = dx * below - dy * right
    if not (dy < 0 or (dy == 0 and dx > 0)):
        inner -= 1
    if dy < 0:
        return max(first, -(inner // (-dy * SUBPIXELS))), end
    if dy > 0:
        return first, min(end, inner // (dy * SUBPIXELS) + 1)
    return first, end if inner >= 0 else first
