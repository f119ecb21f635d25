from __future__ import annotations

import numpy as np

from mien.arrays import Array
from mien.rig.sparse_offsets import SparseOffsets, add_mixture


def few_of_many(rng: np.random.Generator) -> Array:
    """(5, 30, 3): each way moves some vertices, the third none."""
    offsets = rng.normal(size=(5, 30, 3)) * (rng.random((5, 30, 1)) < 0.3)
    offsets[2] = 0
    offsets[4, 7] = [0, 0, 1]
    return offsets


def test_a_sum_of_sparse_offsets_is_the_sum(rng: np.random.Generator) -> None:
    offsets, weights, start = few_of_many(rng), rng.normal(size=5), rng.normal(size=(30, 3))
    weights[3] = 0
    moved = start.copy()
    SparseOffsets.of(offsets).add(weights, moved)
    np.testing.assert_allclose(moved, start + np.tensordot(weights, offsets, axes=1), atol=1e-12)


def test_only_what_moves_is_kept(rng: np.random.Generator) -> None:
    offsets = few_of_many(rng)
    sparse = SparseOffsets.of(offsets.astype(np.float32))
    counts = np.count_nonzero(offsets.any(axis=2), axis=1)
    np.testing.assert_array_equal(np.diff(sparse.starts), counts)
    assert counts[2] == 0
    assert sparse.moves.dtype == np.float64
    assert len(SparseOffsets.of(np.zeros((0, 30, 3))).vertices) == 0


def test_mixtures_with_weights_for_every_vertex(rng: np.random.Generator) -> None:
    offsets, weights = rng.normal(size=(3, 30, 3)), rng.normal(size=(30, 4))
    start = rng.normal(size=(30, 3))
    moved = start.copy()
    add_mixture(weights[:, 1:], offsets, moved)
    expected = start + np.einsum("vk,kvc->vc", weights[:, 1:], offsets)
    np.testing.assert_allclose(moved, expected, atol=1e-12)
