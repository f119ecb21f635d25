"""How deep points lie below a surface: its signed distance where that is negative."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.numeric.kernels.jit import njit


def penetration_depths(
    points: Float[Array, "n 3"],
    vertices: Float[Array, "v 3"],
    triangles: Int[Array, "f 3"],
    border: Bool[Array, " v"],
    max_distance: float,
) -> tuple[Float[Array, " n"], Int[Array, " n"], Float[Array, "n 3"]]:
    """Depth of each point below a surface, and the surface point nearest to it.

    Interpolated vertex normals separate outside from inside.

    Args:
        points: (N, 3).
        vertices: (V, 3).
        triangles: (F, 3), counter-clockwise from outside.
        border: (V,) where the surface ends; nothing is below what touches its border.
        max_distance: points farther from the surface than this count as outside.

    Returns:
        (N,) depth, 0 where the point is outside; (N,) triangle of the nearest surface point, -1
        where the point is outside; (N, 3) its barycentric coordinates.

    Source:
        nearest point of a triangle: Ericson, Real-Time Collision Detection, 5.1.5.
    """
    depth = np.zeros(len(points))
    nearest = np.full(len(points), -1, np.int64)
    weights = np.zeros((len(points), 3))
    _depths(points, vertices, triangles, border, max_distance, depth, nearest, weights)
    return depth, nearest, weights


@njit(cache=True, nogil=True, error_model="numpy")
def _depths(
    points: Array,
    vertices: Array,
    triangles: Array,
    border: Array,
    max_distance: float,
    depth: Array,
    nearest: Array,
    weights: Array,
) -> None:
    centres, radii = _spheres(vertices, triangles)
    normals = _normals(vertices, triangles)
    for n in range(len(points)):
        f, u, v, w = _closest_triangle(points[n], vertices, triangles, centres, radii, max_distance)
        if f < 0:
            continue
        a, b, c = triangles[f]
        # Beyond the surface's end there is no inside.
        if (u > 0 and border[a]) or (v > 0 and border[b]) or (w > 0 and border[c]):
            continue
        along_normal, squared = 0.0, 0.0
        for k in range(3):
            off = points[n, k] - u * vertices[a, k] - v * vertices[b, k] - w * vertices[c, k]
            along_normal += off * (u * normals[a, k] + v * normals[b, k] + w * normals[c, k])
            squared += off * off
        if along_normal < 0:
            depth[n], nearest[n] = np.sqrt(squared), f
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
    """A sphere around each triangle: (3, F) centres and (F,) radii."""
    count = len(triangles)
    centres, radii = np.empty((3, count)), np.zeros(count)
    for f in range(count):
        a, b, c = triangles[f]
        for k in range(3):
            centres[k, f] = (vertices[a, k] + vertices[b, k] + vertices[c, k]) / 3
        for corner in (a, b, c):
            squared = 0.0
            for k in range(3):
                squared += (vertices[corner, k] - centres[k, f]) ** 2
            radii[f] = max(radii[f], np.sqrt(squared))
    return centres, radii


@njit(cache=True, nogil=True, error_model="numpy")
def _closest_triangle(
    point: Array,
    vertices: Array,
    triangles: Array,
    centres: Array,
    radii: Array,
    max_distance: float,
) -> tuple[int, float, float, float]:
    """The triangle nearest to a point, -1 if all are too far, and the barycentrics in it."""
    squared = np.empty(len(triangles))
    _squared_distances(point, centres, squared)
    # The centres are on the surface: the nearest one leaves few triangles to test.
    best = min(np.sqrt(squared.min()) * (1 + 1e-9), max_distance)
    found, u, v, w = -1, 0.0, 0.0, 0.0
    for f in range(len(triangles)):
        limit = best + radii[f]
        if squared[f] >= limit * limit:
            continue
        a, b, c = triangles[f]
        s, t = _closest_point(point, vertices[a], vertices[b], vertices[c])
        distance = 0.0
        for k in range(3):
            nearest = (1 - s - t) * vertices[a, k] + s * vertices[b, k] + t * vertices[c, k]
            distance += (point[k] - nearest) ** 2
        distance = np.sqrt(distance)
        if distance < best:
            best, found, u, v, w = distance, f, 1 - s - t, s, t
    return found, u, v, w


@njit(cache=True, nogil=True, fastmath=True)
def _squared_distances(point: Array, centres: Array, out: Array) -> None:
    for f in range(len(out)):
        x, y, z = point[0] - centres[0, f], point[1] - centres[1, f], point[2] - centres[2, f]
        out[f] = x * x + y * y + z * z


@njit(cache=True, nogil=True, error_model="numpy")
def _closest_point(p: Array, a: Array, b: Array, c: Array) -> tuple[float, float]:
    """Barycentrics at b and c of the triangle's point nearest to p."""
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
