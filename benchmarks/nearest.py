"""The nearest point of a triangle mesh, exactly."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from mien.arrays import Array, Float


class NearestPoint:
    """Nearest points on a surface, for many points at once.

    Large triangles are split, so that every triangle lies within a known, short radius of its
    centroid. A triangle can then only be nearest if its centroid is within the best distance so far
    plus that radius, and a tree of centroids lists those.
    """

    _EDGE_MM = 3.0
    _FIRST, _BLOCK = 8, 4096

    def __init__(self, surface: trimesh.Trimesh) -> None:
        vertices, faces = trimesh.remesh.subdivide_to_size(
            surface.vertices, surface.faces, max_edge=self._EDGE_MM, max_iter=20
        )
        corners = np.asarray(vertices)[faces]
        flat = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        self._triangles = corners[flat > 1e-12]
        centroids = self._triangles.mean(axis=1)
        self._radius = np.linalg.norm(self._triangles - centroids[:, None], axis=2).max(axis=1)
        self._tree = cKDTree(centroids)

    def __call__(
        self, points: Float[Array, "n 3"]
    ) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
        """(N, 3) nearest points and (N,) distances, in the surface's units."""
        closest = np.array(points, np.float64)
        distances = np.full(len(points), np.inf)
        for begin in range(0, len(points), self._BLOCK):
            block = slice(begin, begin + self._BLOCK)
            closest[block], distances[block] = self._search(closest[block])
        return closest, distances

    def _search(
        self, points: Float[Array, "n 3"]
    ) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
        closest, best = points.copy(), np.full(len(points), np.inf)
        open_points, count = np.arange(len(points)), self._FIRST
        while len(open_points):
            count = min(count, len(self._triangles))
            gaps, found = self._tree.query(points[open_points], k=range(1, count + 1))
            self._try(points, open_points, gaps, found, closest, best)
            # Triangles further down the list start at least this far away.
            beyond = gaps[:, -1] - self._radius.max()
            open_points = open_points[(beyond < best[open_points]) & (count < len(self._triangles))]
            count *= 4
        return closest, best

    def _try(
        self,
        points: Float[Array, "n 3"],
        rows: Array,
        gaps: Float[Array, "m k"],
        found: Array,
        closest: Float[Array, "n 3"],
        best: Float[Array, " n"],
    ) -> None:
        """Improves closest and best of these rows by their candidate triangles, in place."""
        for gap, triangles in zip(gaps.T, found.T, strict=True):
            hopeful = gap - self._radius[triangles] < best[rows]
            at, near = rows[hopeful], triangles[hopeful]
            if not len(at):
                continue
            on_triangle = trimesh.triangles.closest_point(self._triangles[near], points[at])
            distance = np.linalg.norm(on_triangle - points[at], axis=1)
            nearer = distance < best[at]
            best[at[nearer]], closest[at[nearer]] = distance[nearer], on_triangle[nearer]
