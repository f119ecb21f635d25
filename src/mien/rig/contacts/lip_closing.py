"""A closed mouth whose lips meet all along."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.rig.contacts.margins import distances_from, fading, full_path, skin_edges

CLOSED_MM = 2.0
"""A mouth whose lips are less far apart in the middle is closed."""
_FAR_MM = 4.0
"""Where a closed mouth's lips are so far apart they are left alone."""
_SPREAD_MM = 7.0


def meet_lips(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
    """The head with lips that meet, half of the gap from either side; an open mouth stays open.

    The generic head's lips are apart by a hair at the corners, and what a photo shows of closed
    lips is one line. They move up and down alone: one lip may lie before the other.

    Args:
        vertices: (V, 3) mm.
    """
    edges = skin_edges(generic, generic.mesh.vertices)
    lines = [
        full_path(edges, generic.polylines[f"{which}_lip_inner"]) for which in ("upper", "lower")
    ]
    upper, lower = (vertices[line] for line in lines)
    middle = np.array([0.5])
    if (_along(upper, middle) - _along(lower, middle))[0, 1] > CLOSED_MM:
        return vertices
    sources = np.concatenate([lines[0], lines[1][1:-1]])
    moves = np.concatenate([_halfway(upper, lower), _halfway(lower, upper)[1:-1]])
    distance, nearest = distances_from(edges, sources)
    carried = np.zeros_like(vertices)
    index: Int[Array, " v"] = np.full(len(vertices), -1)
    index[sources] = np.arange(len(sources))
    near = np.flatnonzero(distance < _SPREAD_MM)
    carried[near] = fading(distance[near], _SPREAD_MM)[:, None] * moves[index[nearest[near]]]
    return vertices + carried


def _halfway(line: Float[Array, "n 3"], other: Float[Array, "m 3"]) -> Float[Array, "n 3"]:
    """(N, 3) mm up or down from each vertex of a lip's edge to halfway to the other lip's."""
    gap = (_along(other, _places(line)) - line)[:, 1]
    share = np.clip((_FAR_MM - np.abs(gap)) / (_FAR_MM - CLOSED_MM), 0, 1)
    return np.outer(gap / 2 * share, [0.0, 1.0, 0.0])


def _places(line: Float[Array, "n 3"]) -> Float[Array, " n"]:
    """From 0 to 1 by the length along a line."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    return length / max(float(length[-1]), 1e-9)


def _along(line: Float[Array, "n 3"], places: Float[Array, " m"]) -> Float[Array, "m 3"]:
    at = _places(line)
    return np.column_stack([np.interp(places, at, line[:, axis]) for axis in range(3)])
