"""Photographed expressions as face units plus what is left: wrinkles come along with the units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float

LEAST_SHARE = 0.05
"""Of a unit's whole movement: a region where it moves less has nothing to do with it."""
_SPARING = 0.05
"""Ridge on how far expressions come along: of two that would do, both a little."""


@dataclass(frozen=True)
class Explanations:
    """K photographed expressions explained by U units.

    Attributes:
        by_region: (R, K, U) weights of the units in each expression, as far as they concern each
            region; neutral's (row 0) are 0.
        left_over: (K, V, 3) mm, what of each expression its units do not explain.
    """

    by_region: Float[Array, "r k u"]
    left_over: Float[Array, "k v 3"]

    @classmethod
    def of(
        cls,
        weights: Float[Array, "k u"],
        units: Float[Array, "u v 3"],
        offsets: Float[Array, "k v 3"],
        masks: Float[Array, "v m"],
    ) -> Explanations:
        """From unit weights and offsets of the expressions, neutral first.

        Args:
            masks: (V, M); the regions are these and the rest of the head.
        """
        moved = np.linalg.norm(units, axis=2)
        total = np.maximum(moved.sum(axis=1), 1e-9)
        shares = (moved @ masks).T / total
        concerns = np.vstack([shares >= LEAST_SHARE, np.ones(len(units), bool)])
        left_over = offsets - np.tensordot(weights, units, axes=1)
        left_over[0] = 0
        return cls(concerns[:, None, :] * weights[None], left_over)

    def driven(self, units: Float[Array, " u"]) -> Float[Array, "r k-1"]:
        """(R, K - 1) how far each expression but neutral comes along with these units.

        In each region the mixture of expressions, weights from 0 up and at most 1 together, whose
        units are nearest to these.
        """
        from scipy.optimize import nnls

        regions, expressions, _ = self.by_region.shape
        driven = np.zeros((regions, expressions - 1))
        if expressions == 1 or not units.any():
            return driven
        for region, known in enumerate(self.by_region[:, 1:]):
            wanted = units * (known != 0).any(axis=0)
            used = (known**2).sum(axis=1) > 1e-6
            if not wanted.any() or not used.any():
                continue
            count = int(used.sum())
            # One more unknown takes what is missing to 1, so that together they are at most 1.
            sum_to_one = np.full(count + 1, _TOGETHER)
            rows = np.column_stack([known[used].T, np.zeros(known.shape[1])])
            ridge = np.column_stack([_SPARING * np.eye(count), np.zeros(count)])
            matrix = np.vstack([rows, ridge, sum_to_one])
            right = np.concatenate([wanted, np.zeros(count), [_TOGETHER]])
            driven[region, used] = nnls(matrix, right)[0][:-1]
        return driven

    def residuals(self, driven: Float[Array, "v k-1"]) -> Float[Array, "v 3"]:
        """(V, 3) mm that come along, by how far each expression does at each vertex."""
        moved: Array = np.einsum("vk,kvc->vc", driven, self.left_over[1:])
        return moved


_TOGETHER = 100.0
"""Weight of the condition that shares sum to 1."""
