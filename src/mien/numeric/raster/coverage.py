"""The triangle at each sample, in strips of rows that fit the processor's cache.

The tests at the edges are numeric.raster.rasterizer's, so that the same samples belong to the same
triangles. Barycentrics, which it writes for every pixel, are computed here from planes of each
triangle, only where they are needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.raster.rasterizer import edge_line

STRIP = 36
"""Rows of samples in a strip, whole pixels of 1, 2 or 3 rows; at full HD it fits into a cache."""

# Side of the blocks of samples whose farthest one is kept; and strips end at whole pixels.
BLOCK = 12

# Columns of Coverage.planes.
X, Y, W0, W1, W2, X1, Y1, X2, Y2 = range(9)


class Coverage(NamedTuple):
    """Triangles on the grid of samples.

    Attributes:
        points: (V, 2) in units of a sample.
        triangles: (F, 3) vertex indices.
        boxes: (F, 4) first and last row, first and last column whose centres a triangle can hold;
            the first row lies after the last where it holds none or cannot be drawn.
        planes: (F, 9) position of the first corner; 1 / z of the three; derivatives of the
            barycentrics of the second and the third by x and y.
        starts: (2 strips + 1,) where each strip's fronts, and then its backs, start in order.
        order: triangles by strip and side, in their own order within each.
        left: first column that the triangles reach, rounded to a block's.
        width: number of columns that they reach, in whole blocks.
    """

    points: Float[Array, "v 2"]
    triangles: Int[Array, "f 3"]
    boxes: Int[Array, "f 4"]
    planes: Float[Array, "f 9"]
    starts: Int[Array, " s"]
    order: Int[Array, " n"]
    left: int
    width: int


def prepare_coverage(
    points: Float[Array, "v 2"],
    depth: Float[Array, " v"],
    triangles: Int[Array, "f 3"],
    width: int,
    height: int,
) -> Coverage:
    """Triangles ready to be drawn on width x height samples, STRIP rows at a time.

    Args:
        points: (V, 2) in units of a sample.
        depth: (V,) camera z; a triangle with a vertex at zero, behind it or not finite is skipped.
        triangles: (F, 3) vertex indices.
        width: in samples.
        height: in samples.
    """
    count = len(triangles)
    boxes, planes = np.empty((count, 4), np.int32), np.empty((count, 9))
    starts = np.zeros(2 * -(-height // STRIP) + 1, np.int64)
    _set_up(points, depth, triangles, width, height, boxes, planes, starts)
    order = np.empty(starts[-1], np.int32)
    _sort(boxes, planes, starts, order)
    used = boxes[boxes[:, 0] <= boxes[:, 1]]
    left = int(used[:, 2].min(initial=width)) // BLOCK * BLOCK
    right = min(-(-int(used[:, 3].max(initial=-1) + 1) // BLOCK) * BLOCK, width)
    return Coverage(points, triangles, boxes, planes, starts, order, left, max(right - left, 0))


@njit(cache=True, nogil=True, error_model="numpy")
def _set_up(
    points: Array,
    depth: Array,
    triangles: Array,
    width: int,
    height: int,
    boxes: Array,
    planes: Array,
    starts: Array,
) -> None:
    """Fill boxes, planes and starts."""
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, bx, cx = points[i, 0], points[j, 0], points[k, 0]
        ay, by, cy = points[i, 1], points[j, 1], points[k, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        za, zb, zc = depth[i], depth[j], depth[k]
        boxes[t, 0], boxes[t, 1] = 0, -1
        drawable = za > 0.0 and zb > 0.0 and zc > 0.0 and za + zb + zc < np.inf
        # The comparisons also refuse NaN, and what would make infinite planes.
        if not (drawable and 1e-30 < abs(area) < np.inf):
            continue
        top = max(np.ceil(min(ay, by, cy) - 0.5), 0.0)
        bottom = min(np.floor(max(ay, by, cy) - 0.5), height - 1.0)
        left = max(np.ceil(min(ax, bx, cx) - 0.5), 0.0)
        right = min(np.floor(max(ax, bx, cx) - 0.5), width - 1.0)
        if not (top <= bottom and left <= right):
            continue
        boxes[t, 0], boxes[t, 1] = int(top), int(bottom)
        boxes[t, 2], boxes[t, 3] = int(left), int(right)
        for strip in range(int(top) // STRIP, int(bottom) // STRIP + 1):
            starts[2 * strip + 1 + (area > 0.0)] += 1
        planes[t, X], planes[t, Y] = ax, ay
        planes[t, W0], planes[t, W1], planes[t, W2] = 1.0 / za, 1.0 / zb, 1.0 / zc
        planes[t, X1], planes[t, Y1] = (cy - ay) / area, (ax - cx) / area
        planes[t, X2], planes[t, Y2] = (ay - by) / area, (bx - ax) / area
    for group in range(1, len(starts)):
        starts[group] += starts[group - 1]


@njit(cache=True, nogil=True)
def _sort(boxes: Array, planes: Array, starts: Array, order: Array) -> None:
    place = starts.copy()
    for t in range(len(boxes)):
        if boxes[t, 0] <= boxes[t, 1]:
            back = not _is_front(planes, t)
            for strip in range(boxes[t, 0] // STRIP, boxes[t, 1] // STRIP + 1):
                order[place[2 * strip + back]] = t
                place[2 * strip + back] += 1


@njit(inline="always")
def _is_front(planes: Array, t: int) -> bool:
    """Counter-clockwise on the screen, as fronts go: the area is negative."""
    return bool(planes[t, X1] * planes[t, Y2] < planes[t, X2] * planes[t, Y1])


@njit(cache=True, nogil=True, error_model="numpy")
def cover_strip(coverage: Coverage, strip: int, ids: Array, nearest: Array) -> tuple[int, int]:
    """Write each sample's triangle, -1 for none; return the first column reached and the end.

    Args:
        coverage: of prepare_coverage.
        strip: its index from the top.
        ids: (STRIP, coverage.width) int32, from column coverage.left on.
        nearest: (STRIP, coverage.width) float32 working memory: 1 / z.
    """
    ids[:] = -1
    nearest[:] = 0.0
    origin = strip * STRIP
    farthest = np.empty((STRIP // BLOCK, -(-coverage.width // BLOCK)), np.float32)
    backs = coverage.starts[2 * strip + 1]
    first, last = coverage.width, -1
    for n in range(coverage.starts[2 * strip], coverage.starts[2 * strip + 2]):
        t = coverage.order[n]
        first = min(first, coverage.boxes[t, 2] - coverage.left)
        last = max(last, coverage.boxes[t, 3] - coverage.left)
        if n == backs:
            _farthest_of_blocks(nearest, farthest)
        # Nearly all backs lie behind fronts: they are culled by blocks of samples.
        if n < backs or not _is_hidden(coverage, t, origin, farthest):
            _cover(coverage, t, origin, ids, nearest)
    return first, last + 1


@njit(cache=True, nogil=True)
def _farthest_of_blocks(nearest: Array, farthest: Array) -> None:
    farthest[:] = np.inf
    for line in range(nearest.shape[0]):
        for block in range(farthest.shape[1]):
            lowest = farthest[line // BLOCK, block]
            for col in range(block * BLOCK, min(block * BLOCK + BLOCK, nearest.shape[1])):
                lowest = min(lowest, nearest[line, col])
            farthest[line // BLOCK, block] = lowest


@njit(inline="always")
def _is_hidden(coverage: Coverage, t: int, origin: int, farthest: Array) -> bool:
    """Whether everything in the blocks that triangle t reaches is nearer than its corners."""
    box, planes = coverage.boxes, coverage.planes
    top, bottom = max(box[t, 0] - origin, 0), min(box[t, 1] - origin, STRIP - 1)
    left, right = box[t, 2] - coverage.left, box[t, 3] - coverage.left
    own = max(planes[t, W0], planes[t, W1], planes[t, W2])
    hidden = True
    for line in range(top // BLOCK, bottom // BLOCK + 1):
        for col in range(left // BLOCK, right // BLOCK + 1):
            hidden = hidden and farthest[line, col] >= own
    return hidden


@njit(inline="always")
def _clip_columns(
    a: float, x0: float, rest: float, least: float, shift: float, left: int, right: int
) -> tuple[int, int]:
    """Of the columns from left to right, the first and the last inside an edge.

    Args:
        a: slope of the edge's function a (x - x0) + rest along the row.
        x0: as there.
        rest: as there.
        least: of the values inside (edge_line).
        shift: rest / a; the edge crosses the row at x0 - shift.
        left: first column.
        right: last column.
    """
    if a == 0.0:
        return (left, right) if rest >= least else (left, left - 1)
    crossing = min(max(x0 - shift - 0.5, left - 1.0), right + 1.0)
    nearest = np.rint(crossing)
    if abs(crossing - nearest) > 1e-6:
        if a > 0.0:
            return max(left, int(np.ceil(crossing))), right
        return left, min(right, int(np.floor(crossing)))
    # Rounding can put the crossing on the wrong side of a centre, so that centre is tested.
    centre = int(nearest)
    inside = a * (centre + 0.5 - x0) + rest >= least
    if a > 0.0:
        return max(left, centre if inside else centre + 1), right
    return left, min(right, centre if inside else centre - 1)


@njit(inline="always")
def _cover(coverage: Coverage, t: int, origin: int, ids: Array, nearest: Array) -> None:
    points, triangles, planes = coverage.points, coverage.triangles, coverage.planes
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    if _is_front(planes, t):
        j, k = k, j
    a0, b0, x0, y0, least0 = edge_line(points, j, k)
    a1, b1, x1, y1, least1 = edge_line(points, k, i)
    a2, b2, x2, y2, least2 = edge_line(points, i, j)
    # Where an edge crosses a row's centres: the column moves by this much a row.
    slope0, slope1, slope2 = b0 / a0, b1 / a1, b2 / a2
    w0 = planes[t, W0]
    rise1, rise2 = planes[t, W1] - w0, planes[t, W2] - w0
    across = rise1 * planes[t, X1] + rise2 * planes[t, X2]
    down = rise1 * planes[t, Y1] + rise2 * planes[t, Y2]
    step = np.float32(across)
    first, last = coverage.boxes[t, 2], coverage.boxes[t, 3]
    top, bottom = max(coverage.boxes[t, 0], origin), min(coverage.boxes[t, 1], origin + STRIP - 1)
    for row in range(top, bottom + 1):
        y = row + 0.5
        left, right = _clip_columns(a0, x0, b0 * (y - y0), least0, slope0 * (y - y0), first, last)
        left, right = _clip_columns(a1, x1, b1 * (y - y1), least1, slope1 * (y - y1), left, right)
        left, right = _clip_columns(a2, x2, b2 * (y - y2), least2, slope2 * (y - y2), left, right)
        # 1/z is linear on the screen.
        start = np.float32(w0 + across * (left + 0.5 - planes[t, X]) + down * (y - planes[t, Y]))
        line = row - origin
        for col in range(left, right + 1):
            w = start + step * np.float32(col - left)
            if w > nearest[line, col - coverage.left]:
                nearest[line, col - coverage.left] = w
                ids[line, col - coverage.left] = t


@njit(inline="always")
def barycentrics_at(planes: Array, t: int, x: float, y: float) -> tuple[float, float, float]:
    """Perspective-correct, clamped to the triangle, summing to 1."""
    dx, dy = x - planes[t, X], y - planes[t, Y]
    second = min(max(planes[t, X1] * dx + planes[t, Y1] * dy, 0.0), 1.0)
    third = min(max(planes[t, X2] * dx + planes[t, Y2] * dy, 0.0), 1.0)
    p0 = max(1.0 - second - third, 0.0) * planes[t, W0]
    p1, p2 = second * planes[t, W1], third * planes[t, W2]
    inverse = 1.0 / (p0 + p1 + p2)
    return p0 * inverse, p1 * inverse, p2 * inverse
