"""Paths and geodesic distances over the edges of the skin mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead


def skin_edges(generic: GenericHead, vertices: Float[Array, "v 3"]) -> csr_matrix:
    """(V, V) length of every edge of the skin, mm; symmetric."""
    triangles = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    a, b = np.unique(pairs, axis=0).T
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    place = (np.concatenate([a, b]), np.concatenate([b, a]))
    return coo_matrix((np.concatenate([length, length]), place), (len(vertices),) * 2).tocsr()


def shortest_path(edges: csr_matrix, corners: Sequence[int]) -> Int[Array, " n"]:
    """All vertices along the shortest path over the mesh through these corners, in order."""
    from scipy.sparse.csgraph import dijkstra

    path = [corners[0]]
    _, before = dijkstra(edges, indices=list(corners[:-1]), return_predecessors=True)
    for row, end in enumerate(corners[1:]):
        leg = [end]
        while leg[-1] != corners[row]:
            leg.append(int(before[row, leg[-1]]))
        path += leg[-2::-1]
    return np.array(path)


def geodesic_distances(
    edges: csr_matrix, sources: Int[Array, " n"]
) -> tuple[Float[Array, " v"], Int[Array, " v"]]:
    """(V,) mm along edges to the nearest source, infinite where there is none; (V,) that source."""
    from scipy.sparse.csgraph import dijkstra

    distance, _, nearest = dijkstra(edges, indices=sources, min_only=True, return_predecessors=True)
    return distance, nearest


def cosine_falloff(distance: Float[Array, " n"], reach: float) -> Float[Array, " n"]:
    """1 at distance 0, 0 from `reach` on, by half a period of the cosine."""
    share = np.clip(distance / reach, 0.0, 1.0)
    return 0.5 + 0.5 * np.cos(np.pi * share)


def behind_margin(edges: csr_matrix, margin: Int[Array, " n"], front: int) -> Int[Array, " v"]:
    """Vertices that a closed margin separates from the one in front."""
    from scipy.sparse.csgraph import connected_components

    kept = np.setdiff1d(np.arange(edges.shape[0]), margin)
    _, label = connected_components(edges[kept][:, kept], directed=False)
    return kept[label != label[kept == front]]
