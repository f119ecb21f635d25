"""Sums of offsets, touching only the vertices that they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, frozen
from mien.numeric.kernels.jit import njit


@dataclass(frozen=True)
class SparseOffsets:
    """U ways to move a head, most of which move few of its vertices.

    Attributes:
        starts: (U + 1,) where each one's entries begin, and where the last one's end.
        vertices: (N,) unsigned, that an entry moves.
        moves: (N, 3) mm at weight 1.
    """

    starts: Int[Array, " u+1"]
    vertices: Int[Array, " n"]
    moves: Float[Array, "n 3"]

    @classmethod
    def of(cls, offsets: Float[Array, "u v 3"]) -> SparseOffsets:
        """From (U, V, 3) mm."""
        way, vertices = np.nonzero(np.any(offsets, axis=2))
        starts = np.searchsorted(way, np.arange(len(offsets) + 1))
        moves = np.asarray(offsets[way, vertices], np.float64)
        # Indices that may be negative would be looked at one by one.
        return cls(frozen(starts), frozen(vertices.astype(np.uint32)), frozen(moves))

    def add(self, weights: Float[Array, " u"], vertices: Float[Array, "v 3"]) -> None:
        """Moves vertices, (V, 3) mm, in place, each way by its weight."""
        _add(weights, self.starts, self.vertices, self.moves, vertices)


@njit(cache=True, nogil=True)
def add_mixture(
    weights: Float[Array, "v k"], offsets: Float[Array, "k v 3"], vertices: Float[Array, "v 3"]
) -> None:
    """Moves vertices, (V, 3) mm, in place by offsets that each vertex mixes its own way."""
    for k in range(len(offsets)):
        for v in range(len(vertices)):
            for axis in range(3):
                vertices[v, axis] += weights[v, k] * offsets[k, v, axis]


@njit(cache=True, nogil=True)
def _add(weights: Array, starts: Array, moved: Array, moves: Array, vertices: Array) -> None:
    for way in range(len(weights)):
        weight = weights[way]
        if weight == 0:
            continue
        for n in range(starts[way], starts[way + 1]):
            for axis in range(3):
                vertices[moved[n], axis] += weight * moves[n, axis]
