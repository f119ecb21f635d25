"""Walks over a mesh of quads."""

from __future__ import annotations

from collections import defaultdict
from functools import cached_property

import numpy as np

from mien.arrays import Array, Int


class QuadTopology:
    """Which quads and edges of a quad mesh touch.

    Attributes:
        quads: (Q, 4) vertex indices.
        faces_of: the quads on either side of every edge.
    """

    def __init__(self, quads: Int[Array, "q 4"]) -> None:
        self.quads = quads
        self.faces_of: dict[frozenset[int], list[int]] = defaultdict(list)
        for index, quad in enumerate(quads.tolist()):
            for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
                self.faces_of[frozenset((a, b))].append(index)

    @cached_property
    def edges_at(self) -> dict[int, list[frozenset[int]]]:
        """The edges that meet at every vertex."""
        edges: dict[int, list[frozenset[int]]] = defaultdict(list)
        for edge in self.faces_of:
            for vertex in edge:
                edges[vertex].append(edge)
        return edges

    def edge_loop(self, first: int, second: int) -> list[int]:
        """The closed loop of edges that goes straight on at every four-valent vertex.

        Returns:
            its vertices in order, or [] when it ends at an irregular vertex or a boundary.
        """
        loop = [first, second]
        while len(loop) <= len(self.faces_of):
            edge = frozenset(loop[-2:])
            sides = set(self.faces_of[edge])
            around = self.edges_at[loop[-1]]
            onward = [other for other in around if not sides & set(self.faces_of[other])]
            if len(around) != 4 or len(onward) != 1:
                return []
            (vertex,) = onward[0] - {loop[-1]}
            if vertex == first:
                return loop
            loop.append(vertex)
        return []

    def flood(self, seed: int, walls: set[frozenset[int]]) -> Int[Array, " n"]:
        """Quads reached from the seed over shared edges without crossing a wall, sorted."""
        reached, frontier = {seed}, [seed]
        while frontier:
            quad = self.quads[frontier.pop()].tolist()
            for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
                edge = frozenset((a, b))
                if edge not in walls:
                    new = [face for face in self.faces_of[edge] if face not in reached]
                    reached.update(new)
                    frontier.extend(new)
        return np.array(sorted(reached))
