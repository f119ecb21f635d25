"""Rasterization: the triangle at every pixel, its barycentrics and its depth.

Pixel (column, row) is sampled at its centre (column + 0.5, row + 0.5). Edges are tested with the
same arithmetic from both sides and the top-left rule, so that a point on an edge that two
triangles share belongs to exactly one of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, check_array, check_positive, frozen
from mien.errors import InputError
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands

_ABOVE_ZERO = float(np.nextafter(0.0, 1.0))


@dataclass(frozen=True)
class Raster:
    """A mesh rasterized by a camera.

    Attributes:
        triangle_ids: (H, W) int32, -1 where there is no triangle.
        barycentrics: (H, W, 3) float32, perspective-correct, summing to 1; zero outside.
        depth: (H, W) float32, camera z; infinite outside.
    """

    triangle_ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    depth: Float[Array, "h w"]

    @property
    def mask(self) -> Array:
        """(H, W) bool: where there is a triangle."""
        return self.triangle_ids >= 0


def rasterize(
    vertices_px: Float[Array, "v 2"],
    depth: Float[Array, " v"],
    triangles: Int[Array, "f 3"],
    width: int,
    height: int,
    *,
    cull: bool = False,
) -> Raster:
    """The nearest triangle at every pixel's centre; of several equally near, the first.

    Args:
        vertices_px: (V, 2) px.
        depth: (V,) camera z; a triangle with a vertex at zero, behind it or not finite is skipped.
        triangles: (F, 3) vertex indices, counter-clockwise as the camera sees their front.
        width: px.
        height: px.
        cull: leave out back faces.

    Raises:
        InputError: shapes, sizes, an index out of range.
    """
    for name, size in (("width", width), ("height", height)):
        check_positive(name, size)
    vertices_px = check_array("vertices_px", vertices_px, (None, 2), finite=False)
    depth = check_array("depth", depth, (len(vertices_px),), finite=False)
    triangles = check_triangles(triangles, len(vertices_px))
    raster = empty_raster(width, height)
    inputs = [frozen(np.ascontiguousarray(array)) for array in (vertices_px, depth, triangles)]
    outputs = (raster.triangle_ids, raster.barycentrics, raster.depth)

    def rows(first: int, end: int) -> None:
        rasterize_rows(*inputs, cull, first, end, *outputs)

    for_row_bands(rows, height, work=2 * len(triangles) + width * height)
    return raster


def empty_raster(width: int, height: int) -> Raster:
    """A raster whose memory rasterize_rows is the first to touch, in its threads."""
    shape = (height, width)
    ids, depth = np.empty(shape, np.int32), np.empty(shape, np.float32)
    return Raster(ids, np.empty((*shape, 3), np.float32), depth)


def interpolate(
    raster: Raster, triangles: Int[Array, "f 3"], values: Float[Array, "v c"]
) -> Float[Array, "h w c"]:
    """Values at the vertices, interpolated over the pixels: (H, W, C) float32, zero outside.

    Raises:
        InputError: shapes, an index out of range.
    """
    values = check_array("values", values, (None, None), dtype=np.float32, finite=False)
    triangles = check_triangles(triangles, len(values))
    if raster.triangle_ids.max(initial=-1) >= len(triangles):
        raise InputError("triangles", "those that were rasterised", f"only {len(triangles)}")
    height, width = raster.triangle_ids.shape
    out = np.zeros((height, width, values.shape[1]), np.float32)
    arrays = (raster.triangle_ids, raster.barycentrics, triangles, values)
    inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]
    for_row_bands(lambda a, b: _interpolate_rows(*inputs, a, b, out), height, work=width * height)
    return out


def check_triangles(triangles: object, vertices: int) -> Int[Array, "f 3"]:
    """(F, 3) int32 indices below the number of vertices. Raises: InputError."""
    indices = check_array("triangles", triangles, (None, 3), dtype=np.int32)
    if indices.size and not (indices.min() >= 0 and indices.max() < vertices):
        found = f"{indices.min()} to {indices.max()}"
        raise InputError("triangles", f"indices from 0 to {vertices - 1}", found)
    return indices


@njit(inline="always")
def edge_line(vertices_px: Array, i: int, j: int) -> tuple[float, float, float, float, float]:
    """The line i-j as a (x - x0) + b (y - y0), and the least value of that inside.

    Inside is to the right when walking from i to j with y pointing down. Both triangles at an
    edge compute the same numbers with opposite signs, and zero at either end; zero is inside one.
    """
    low, high = min(i, j), max(i, j)
    x0, y0 = vertices_px[low, 0], vertices_px[low, 1]
    dx, dy = vertices_px[high, 0] - x0, vertices_px[high, 1] - y0
    sign = 1.0 if i < j else -1.0
    a, b = -sign * dy, sign * dx
    return a, b, x0, y0, 0.0 if a > 0.0 or (a == 0.0 and b > 0.0) else _ABOVE_ZERO


@njit(inline="always")
def _bounds(a: float) -> tuple[float, float, float]:
    """1 / a, and offsets from an edge's crossing of a row to the first and last column inside.

    With rounding the columns may include one too many, but miss none. An edge along the rows
    bounds no columns.
    """
    if abs(a) < 1e-12:
        return 0.0, -np.inf, np.inf
    return 1.0 / a, (-1e-6 if a > 0.0 else -np.inf), (1e-6 if a < 0.0 else np.inf)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_triangle(
    vertices_px: Array,
    depth: Array,
    triangles: Array,
    t: int,
    flip: bool,
    box: tuple[int, int, int, int],
    ids: Array,
    barycentrics: Array,
    nearest: Array,
) -> None:
    """Write triangle t where it is the nearest so far.

    Args:
        vertices_px: as for rasterize_rows, like the other arrays.
        depth: as there.
        triangles: as there.
        t: index of the triangle.
        flip: its corners go counter-clockwise on the screen, as those of a front do.
        box: first and last row, first and last column that it can reach.
        ids: as there.
        barycentrics: as there.
        nearest: as there.
    """
    second, third = (2, 1) if flip else (1, 2)
    i, j, k = triangles[t, 0], triangles[t, second], triangles[t, third]
    a0, b0, x0, y0, least0 = edge_line(vertices_px, j, k)
    a1, b1, x1, y1, least1 = edge_line(vertices_px, k, i)
    a2, b2, x2, y2, least2 = edge_line(vertices_px, i, j)
    wi, wj, wk = 1.0 / depth[i], 1.0 / depth[j], 1.0 / depth[k]
    top, bottom, left, right = box
    s0, before0, after0 = _bounds(a0)
    s1, before1, after1 = _bounds(a1)
    s2, before2, after2 = _bounds(a2)
    for row in range(top, bottom + 1):
        y = row + 0.5
        r0, r1, r2 = b0 * (y - y0), b1 * (y - y1), b2 * (y - y2)
        c0, c1, c2 = x0 - r0 * s0 - 0.5, x1 - r1 * s1 - 0.5, x2 - r2 * s2 - 0.5
        # The box comes first, for then NaN, of numbers that are too large, changes nothing.
        low = min(max(float(left), c0 + before0, c1 + before1, c2 + before2), right + 1.0)
        high = max(min(float(right), c0 + after0, c1 + after1, c2 + after2), left - 1.0)
        for col in range(int(np.ceil(low)), int(np.floor(high)) + 1):
            x = col + 0.5
            e0, e1, e2 = a0 * (x - x0) + r0, a1 * (x - x1) + r1, a2 * (x - x2) + r2
            # One branch: a mispredicted one costs more than the tests.
            if not ((e0 >= least0) & (e1 >= least1) & (e2 >= least2)):
                continue
            # 1/z is linear on the screen.
            p0, p1, p2 = e0 * wi, e1 * wj, e2 * wk
            inverse = 1.0 / (p0 + p1 + p2)
            z = np.float32((e0 + e1 + e2) * inverse)
            if z < nearest[row, col]:
                nearest[row, col] = z
                ids[row, col] = t
                barycentrics[row, col, 0] = p0 * inverse
                barycentrics[row, col, second] = p1 * inverse
                barycentrics[row, col, third] = p2 * inverse


@njit(cache=True, nogil=True, error_model="numpy")
def rasterize_rows(
    vertices_px: Array,
    depth: Array,
    triangles: Array,
    cull: bool,
    first: int,
    end: int,
    ids: Array,
    barycentrics: Array,
    nearest: Array,
) -> None:
    """Fill in rows first to end - 1 of what a Raster consists of; see rasterize."""
    ids[first:end] = -1
    barycentrics[first:end] = 0.0
    nearest[first:end] = np.inf
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay = vertices_px[i, 0], vertices_px[i, 1]
        bx, by = vertices_px[j, 0], vertices_px[j, 1]
        cx, cy = vertices_px[k, 0], vertices_px[k, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        # Pixels whose centre lies in the bounding box; the comparisons also refuse NaN.
        top = max(np.ceil(min(ay, by, cy) - 0.5), float(first))
        bottom = min(np.floor(max(ay, by, cy) - 0.5), end - 1.0)
        left = max(np.ceil(min(ax, bx, cx) - 0.5), 0.0)
        right = min(np.floor(max(ax, bx, cx) - 0.5), ids.shape[1] - 1.0)
        shown = (area < 0.0) | ((area > 0.0) & (not cull))
        if not (shown and top <= bottom and left <= right):
            continue
        za, zb, zc = depth[i], depth[j], depth[k]
        if za > 0.0 and zb > 0.0 and zc > 0.0 and za + zb + zc < np.inf:
            box = (int(top), int(bottom), int(left), int(right))
            _fill_triangle(
                vertices_px, depth, triangles, t, area < 0.0, box, ids, barycentrics, nearest
            )


@njit(cache=True, nogil=True)
def _interpolate_rows(
    ids: Array,
    barycentrics: Array,
    triangles: Array,
    values: Array,
    first: int,
    end: int,
    out: Array,
) -> None:
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0:
                continue
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            p0 = barycentrics[row, col, 0]
            p1 = barycentrics[row, col, 1]
            p2 = barycentrics[row, col, 2]
            for c in range(values.shape[1]):
                out[row, col, c] = p0 * values[i, c] + p1 * values[j, c] + p2 * values[k, c]
