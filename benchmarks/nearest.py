"""The nearest point of a triangle mesh, exactly."""

from __future__ import annotations

import numpy as np
import trimesh

from mien.arrays import Array, Float, Int, frozen
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands

_LEAF = 4
_WORK = 100
"""What a search costs, in pixels."""


class NearestPoint:
    """Nearest points on a surface, for many points at once.

    The triangles are halved again and again along the longest side of the box around them; a
    search enters a box only while it may hold something nearer than the best so far. Node i of
    this tree has children 2 i + 1 and 2 i + 2, and all leaves lie on its last level.
    """

    def __init__(self, surface: trimesh.Trimesh) -> None:
        corners = np.array(surface.vertices, np.float64)[np.asarray(surface.faces)]
        a, b, c = (corners[:, corner] for corner in range(3))
        flat = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        corners = corners[flat > 1e-12]
        order, edges = _halved(corners.mean(axis=1))
        corners = corners[order]
        low, high = _boxes(corners, edges)
        self._arrays = [frozen(array) for array in (corners, edges, low, high)]

    def __call__(
        self, points: Float[Array, "n 3"]
    ) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
        """(N, 3) nearest points and (N,) distances, in the surface's units."""
        closest = np.empty((len(points), 3))
        inputs = [frozen(np.ascontiguousarray(points, np.float64)), *self._arrays]
        for_row_bands(
            lambda first, end: _search_rows(*inputs, first, end, closest),
            len(points),
            work=_WORK * len(points),
        )
        return closest, np.linalg.norm(closest - points, axis=1)


def _halved(centroids: Float[Array, "f 3"]) -> tuple[Int[Array, " f"], Int[Array, " e"]]:
    """An order of the triangles in which leaves are runs, and the (leaves + 1) ends of the runs."""
    groups = [np.arange(len(centroids))]
    while max(map(len, groups)) > _LEAF:
        groups = [half for group in groups for half in _halves(centroids, group)]
    edges = np.cumsum([0, *map(len, groups)])
    return np.concatenate(groups), edges


def _halves(centroids: Float[Array, "f 3"], group: Int[Array, " g"]) -> list[Int[Array, " h"]]:
    middle = len(group) // 2
    if middle == 0:
        return [group[:0], group]
    axis = np.ptp(centroids[group], axis=0).argmax()
    by_place = group[np.argpartition(centroids[group, axis], middle)]
    return [by_place[:middle], by_place[middle:]]


def _boxes(corners: Float[Array, "f 3 3"], edges: Int[Array, " e"]) -> tuple[Array, Array]:
    """(2 x leaves - 1, 3) lower and upper corners of the nodes' boxes; inside out where empty."""
    leaves = len(edges) - 1
    low = np.full((2 * leaves - 1, 3), np.inf)
    high = -low
    for leaf in range(leaves):
        mine = corners[edges[leaf] : edges[leaf + 1]].reshape(-1, 3)
        low[leaves - 1 + leaf] = mine.min(axis=0, initial=np.inf)
        high[leaves - 1 + leaf] = mine.max(axis=0, initial=-np.inf)
    for node in range(leaves - 2, -1, -1):
        children = slice(2 * node + 1, 2 * node + 3)
        low[node], high[node] = low[children].min(axis=0), high[children].max(axis=0)
    return low, high


@njit(cache=True, nogil=True)
def _search_rows(
    points: Array,
    corners: Array,
    edges: Array,
    low: Array,
    high: Array,
    first: int,
    end: int,
    closest: Array,
) -> None:
    leaves = len(edges) - 1
    stack, there = np.empty(64, np.int64), np.empty(3)
    for row in range(first, end):
        point, best = points[row], np.inf
        stack[0], count = 0, 1
        while count > 0:
            count -= 1
            node = stack[count]
            if _box_gap(point, low[node], high[node]) >= best:
                continue
            if node >= leaves - 1:
                leaf = node - (leaves - 1)
                for t in range(edges[leaf], edges[leaf + 1]):
                    gap = _on_triangle(point, corners[t], there)
                    if gap < best:
                        best = gap
                        closest[row] = there
                continue
            near, far = 2 * node + 1, 2 * node + 2
            if _box_gap(point, low[far], high[far]) < _box_gap(point, low[near], high[near]):
                near, far = far, near
            stack[count], stack[count + 1] = far, near
            count += 2


@njit(cache=True, nogil=True)
def _box_gap(point: Array, low: Array, high: Array) -> float:
    """Squared distance from a point to a box."""
    total = 0.0
    for axis in range(3):
        gap = max(low[axis] - point[axis], point[axis] - high[axis], 0.0)
        total += gap * gap
    return total


@njit(cache=True, nogil=True)
def _on_triangle(p: Array, corners: Array, out: Array) -> float:
    """Write the nearest point of a triangle; squared distance to it.

    Source:
        Ericson, Real-Time Collision Detection, 2005, sec. 5.1.5: which corner, edge or the

    face is nearest follows from the signs of six dot products.
    """
    a, b, c = corners[0], corners[1], corners[2]
    ab, ac = b - a, c - a
    d1, d2 = _dot(ab, p - a), _dot(ac, p - a)
    d3, d4 = _dot(ab, p - b), _dot(ac, p - b)
    d5, d6 = _dot(ab, p - c), _dot(ac, p - c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    gap = 0.0
    for axis in range(3):
        out[axis] = a[axis] + v * ab[axis] + w * ac[axis]
        gap += (out[axis] - p[axis]) ** 2
    return gap


@njit(cache=True, nogil=True)
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
