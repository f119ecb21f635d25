"""Lashes and hair, which follow the nearest skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, frozen
from mien.assets.generic import GenericHead

_PARTS = ("lashes", "hair")
_NEIGHBOURS = 4
_LEAST_MM = 0.2


@dataclass(frozen=True)
class Followers:
    """Skinning weights of lashes and hair on the nearest skin vertices.

    Attributes:
        vertices: (N,) the lashes' and the hair's vertices.
        carriers: (N, 4) skin vertices nearest on the generic head.
        weights: (N, 4) summing to 1.
    """

    vertices: Int[Array, " n"]
    carriers: Int[Array, "n 4"]
    weights: Float[Array, "n 4"]

    @staticmethod
    def of(generic: GenericHead) -> Followers:
        """The followers of the generic topology."""
        from scipy.spatial import cKDTree

        vertices = generic.mesh.vertices_of(*_PARTS)
        skin = generic.mesh.vertices_of("skin")
        places = generic.mesh.vertices
        distance, nearest = cKDTree(places[skin]).query(places[vertices], k=_NEIGHBOURS)
        weights = 1 / np.maximum(distance, _LEAST_MM) ** 2
        weights /= weights.sum(axis=1, keepdims=True)
        return Followers(frozen(vertices), frozen(skin[nearest]), frozen(weights))

    def of_skin(self, vertices: Int[Array, " s"]) -> Followers:
        """The followers of these skin vertices."""
        some = np.isin(self.carriers, vertices).any(axis=1)
        parts = (self.vertices, self.carriers, self.weights)
        return Followers(*(frozen(part[some]) for part in parts))

    def carried(self, offsets: Float[Array, "*k v 3"]) -> Float[Array, "*k n 3"]:
        """(..., N, 3) offsets of the followers from offsets of the skin."""
        return np.einsum("...nic,ni->...nc", offsets[..., self.carriers, :], self.weights)
