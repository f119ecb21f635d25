"""Edges that a triangulation must have, by flips."""

from __future__ import annotations

from itertools import combinations
from typing import Any

from mien.arrays import Array


def with_edge(triangles: Array, places: Array, start: int, end: int) -> Array:
    """The same triangles after flips that make this pair an edge."""
    for _ in range(100):
        crossing = [
            pair for pair in inner_edges(triangles) if crosses(places, (start, end), pair[0])
        ]
        if not crossing:
            return triangles
        for (p, q), (one, other) in crossing:
            (r,) = set(triangles[one]) - {p, q}
            (s,) = set(triangles[other]) - {p, q}
            if crosses(places, (p, q), (r, s)):  # Only a convex pair can be flipped.
                triangles = triangles.copy()
                triangles[one], triangles[other] = (r, s, p), (r, s, q)
                break
    raise AssertionError(f"no edge from {start} to {end}")


def inner_edges(triangles: Array) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Each edge between two triangles with these two."""
    sides: dict[tuple[int, int], list[int]] = {}
    for number, triangle in enumerate(triangles.tolist()):
        for a, b in combinations(sorted(triangle), 2):
            sides.setdefault((a, b), []).append(number)
    return [(edge, (found[0], found[1])) for edge, found in sides.items() if len(found) == 2]


def crosses(places: Array, edge: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two edges without a common end cross."""
    if set(edge) & set(other):
        return False
    (a, b), (c, d) = places[list(edge)], places[list(other)]
    apart = cross(b - a, c - a) * cross(b - a, d - a) < 0
    return bool(apart and cross(d - c, a - c) * cross(d - c, b - c) < 0)


def cross(a: Array, b: Array) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
