"""Weighted sums of sparse vertex offsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, frozen
from mien.numeric.kernels.jit import njit


@dataclass(frozen=True)
class SparseOffsets:
    """Offsets of U units, each of which moves few vertices.

    Attributes:
        starts: (U + 1,) where the entries of each unit begin, and where the last ones end.
        vertices: (N,) unsigned, the vertex of each entry.
        moves: (N, 3) mm at weight 1.
    """

    starts: Int[Array, " u+1"]
    vertices: Int[Array, " n"]
    moves: Float[Array, "n 3"]

    @classmethod
    def of(cls, offsets: Float[Array, "u v 3"]) -> SparseOffsets:
        """From (U, V, 3) mm."""
        unit, vertices = np.nonzero(np.any(offsets, axis=2))
        starts = np.searchsorted(unit, np.arange(len(offsets) + 1))
        moves = np.asarray(offsets[unit, vertices], np.float64)
        # Unsigned: the kernel then skips the check for negative indices.
        return cls(frozen(starts), frozen(vertices.astype(np.uint32)), frozen(moves))

    def add(self, weights: Float[Array, " u"], vertices: Float[Array, "v 3"]) -> None:
        """Moves vertices, (V, 3) mm, in place by the weighted units."""
        _add(weights, self.starts, self.vertices, self.moves, vertices)


@njit(cache=True, nogil=True)
def add_mixture(
    weights: Float[Array, "v k"], offsets: Float[Array, "k v 3"], vertices: Float[Array, "v 3"]
) -> None:
    """Moves vertices, (V, 3) mm, in place by offsets with weights for each vertex."""
    for k in range(len(offsets)):
        for v in range(len(vertices)):
            for axis in range(3):
                vertices[v, axis] += weights[v, k] * offsets[k, v, axis]


@njit(cache=True, nogil=True)
def _add(weights: Array, starts: Array, moved: Array, moves: Array, vertices: Array) -> None:
    for unit in range(len(weights)):
        weight = weights[unit]
        if weight == 0:
            continue
        for n in range(starts[unit], starts[unit + 1]):
            for axis in range(3):
                vertices[moved[n], axis] += weight * moves[n, axis]
