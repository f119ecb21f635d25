"""How deep points lie under a surface."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.numeric.kernels.jit import njit


def penetration_depths(
    points: Float[Array, "n 3"],
    vertices: Float[Array, "v 3"],
    triangles: Int[Array, "f 3"],
    border: Bool[Array, " v"],
    reach: float,
) -> tuple[Float[Array, " n"], Int[Array, " n"], Float[Array, "n 3"]]:
    """Depth of each point below the nearest place of a surface, and that place.

    Args:
        points: (N, 3).
        vertices: (V, 3).
        triangles: (F, 3), counter-clockwise from outside.
        border: (V,) where the surface ends; nothing is below what touches its border.
        reach: points further from the surface than this count as outside.

    Returns:
        (N,) depth, 0 where the point is outside; (N,) triangle of the nearest place, -1 where the
        point is outside; (N, 3) its barycentric coordinates.

    The surface's normals at its vertices, interpolated, tell outside from inside.

    Source:
        the nearest place is found as in Ericson, Real-Time Collision Detection, 5.1.5.
    """
    depth = np.zeros(len(points))
    place = np.full(len(points), -1, np.int64)
    weights = np.zeros((len(points), 3))
    _depths(points, vertices, triangles, border, reach, depth, place, weights)
    return depth, place, weights


@njit(cache=True, nogil=True, error_model="numpy")
def _depths(
    points: Array,
    vertices: Array,
    triangles: Array,
    border: Array,
    reach: float,
    depth: Array,
    place: Array,
    weights: Array,
) -> None:
    middles, sizes = _spheres(vertices, triangles)
    normals = _normals(vertices, triangles)
    for n in range(len(points)):
        f, u, v, w = _nearest_triangle(points[n], vertices, triangles, middles, sizes, reach)
        if f < 0:
            continue
        a, b, c = triangles[f]
        # Beyond the surface's end there is no inside.
        if (u > 0 and border[a]) or (v > 0 and border[b]) or (w > 0 and border[c]):
            continue
        side, away = 0.0, 0.0
        for k in range(3):
            off = points[n, k] - u * vertices[a, k] - v * vertices[b, k] - w * vertices[c, k]
            side += off * (u * normals[a, k] + v * normals[b, k] + w * normals[c, k])
            away += off * off
        if side < 0:
            depth[n], place[n] = np.sqrt(away), f
            weights[n, 0], weights[n, 1], weights[n, 2] = u, v, w


@njit(cache=True, nogil=True, error_model="numpy")
def _normals(vertices: Array, triangles: Array) -> Array:
    """(V, 3) outward at the vertices, weighted by area, of any length."""
    normals = np.zeros((len(vertices), 3))
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            first = (vertices[b, i] - vertices[a, i]) * (vertices[c, j] - vertices[a, j])
            second = (vertices[b, j] - vertices[a, j]) * (vertices[c, i] - vertices[a, i])
            for corner in (a, b, c):
                normals[corner, k] += first - second
    return normals


@njit(cache=True, nogil=True, error_model="numpy")
def _spheres(vertices: Array, triangles: Array) -> tuple[Array, Array]:
    """A sphere around each triangle: (3, F) middles and (F,) radii."""
    count = len(triangles)
    middles, sizes = np.empty((3, count)), np.zeros(count)
    for f in range(count):
        a, b, c = triangles[f]
        for k in range(3):
            middles[k, f] = (vertices[a, k] + vertices[b, k] + vertices[c, k]) / 3
        for corner in (a, b, c):
            away = 0.0
            for k in range(3):
                away += (vertices[corner, k] - middles[k, f]) ** 2
            sizes[f] = max(sizes[f], np.sqrt(away))
    return middles, sizes


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_triangle(
    point: Array, vertices: Array, triangles: Array, middles: Array, sizes: Array, reach: float
) -> tuple[int, float, float, float]:
    """The triangle nearest to a point, -1 if none is in reach, and where in it."""
    away = np.empty(len(triangles))
    _squared_distances(point, middles, away)
    # The middles are on the surface: the nearest one leaves few triangles to look at.
    best = min(np.sqrt(away.min()) * (1 + 1e-9), reach)
    found, u, v, w = -1, 0.0, 0.0, 0.0
    for f in range(len(triangles)):
        limit = best + sizes[f]
        if away[f] >= limit * limit:
            continue
        a, b, c = triangles[f]
        s, t = _nearest(point, vertices[a], vertices[b], vertices[c])
        gap = 0.0
        for k in range(3):
            place = (1 - s - t) * vertices[a, k] + s * vertices[b, k] + t * vertices[c, k]
            gap += (point[k] - place) ** 2
        gap = np.sqrt(gap)
        if gap < best:
            best, found, u, v, w = gap, f, 1 - s - t, s, t
    return found, u, v, w


@njit(cache=True, nogil=True, fastmath=True)
def _squared_distances(point: Array, middles: Array, out: Array) -> None:
    for f in range(len(out)):
        x, y, z = point[0] - middles[0, f], point[1] - middles[1, f], point[2] - middles[2, f]
        out[f] = x * x + y * y + z * z


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest(p: Array, a: Array, b: Array, c: Array) -> tuple[float, float]:
    """Weights of b and c of the nearest place in the triangle."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = b[k] - a[k], c[k] - a[k]
        d1 += ab * (p[k] - a[k])
        d2 += ac * (p[k] - a[k])
        d3 += ab * (p[k] - b[k])
        d4 += ac * (p[k] - b[k])
        d5 += ab * (p[k] - c[k])
        d6 += ac * (p[k] - c[k])
    if d1 <= 0 and d2 <= 0:
        return 0.0, 0.0
    if d3 >= 0 and d4 <= d3:
        return 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        return d1 / (d1 - d3), 0.0
    if d6 >= 0 and d5 <= d6:
        return 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        return 0.0, d2 / (d2 - d6)
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1 - t, t
    total = va + vb + vc
    return vb / total, vc / total
