"""Lips: they meet, and do not pass through each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.generic import GenericHead
from mien.numeric.signed_distance import penetration_depths
from mien.rig.skin_paths import cosine_falloff, geodesic_distances, shortest_path, skin_edges

_PATCH_MM = 14.0
"""Skin so near to the line where the lips meet is lip, front and back."""
_TESTED_MM = 8.0
_SPREAD_MM = 6.0
"""How far a correction of one vertex goes along."""
_DEEPEST_MM = 6.0
_TOLERANCE_MM = 0.05
_STEP = 0.6
"""Share of its depth by which a vertex gives way in a round; the other lip does so too."""
_STEEPEST = 0.5
"""The way up counts as no longer than twice the nearest way out."""
_ROUNDS = 4
CLOSED_MM = 2.0
"""A mouth whose lips are less far apart in the middle is closed."""
_OPEN_MM = 4.0
"""Where a closed mouth's lips are so far apart they are left alone."""
_CLOSING_SPREAD_MM = 7.0


@dataclass(frozen=True)
class Lip:
    """The upper or the lower lip, from its skin around the red to its back.

    Attributes:
        vertices: (P,) of the mesh.
        triangles: (F, 3) into them.
        border: (P,) where it ends.
        tested: (T,) those that can get into the other lip.
        spread: (P, T) how far a correction of a tested vertex goes along; 1 at itself.
        allowed: (T,) mm, how deep each is in the other lip when the face is neutral.
        upwards: 1 for the upper lip, -1 for the lower: where it gives way to.
    """

    vertices: Int[Array, " p"]
    triangles: Int[Array, "f 3"]
    border: Bool[Array, " p"]
    tested: Int[Array, " t"]
    spread: Float[Array, "p t"]
    allowed: Float[Array, " t"]
    upwards: float


@dataclass(frozen=True)
class Lips:
    """Both lips of one head."""

    upper: Lip
    lower: Lip

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Lips:
        """For a head with these neutral vertices, (V, 3) mm: what touches now may go on so."""
        edges = skin_edges(generic, generic.mesh.vertices)
        upper, lower = (
            shortest_path(edges, generic.polylines[f"{which}_lip_inner"])
            for which in ("upper", "lower")
        )
        distance, nearest = geodesic_distances(edges, np.concatenate([upper, lower[1:-1]]))
        first, second = (
            _lip(generic, edges, np.where(np.isin(nearest, line[1:-1]), distance, np.inf), upwards)
            for line, upwards in ((upper, 1.0), (lower, -1.0))
        )
        first_depth, second_depth = _depths(first, second, vertices)
        return Lips(_allowing(first, first_depth), _allowing(second, second_depth))

    def depths(self, vertices: Float[Array, "v 3"]) -> Float[Array, " t"]:
        """mm by which the tested vertices of both lips are in the other one; 0 outside."""
        return np.concatenate(_depths(self.upper, self.lower, vertices))

    @property
    def allowed(self) -> Float[Array, " t"]:
        """mm, the depths of the neutral face."""
        return np.concatenate([self.upper.allowed, self.lower.allowed])


def resolve_lips(
    lips: Lips, vertices: Float[Array, "v 3"], *, rounds: int = _ROUNDS
) -> Float[Array, "v 3"] | None:
    """(V, 3) mm that takes the lips out of each other; None where they are not in each other.

    In every round vertices of the upper lip that are in the lower one give way upwards, those of
    the lower lip downwards, and the skin around goes along. (The nearest way out may lead through
    the front of the other lip.)
    """
    upper, lower = lips.upper, lips.lower
    places = above, below = vertices[upper.vertices], vertices[lower.vertices]
    up, down = _corrections(upper, above, lower, below), _corrections(lower, below, upper, above)
    if not (up.any() or down.any()):
        return None
    # Where nothing touches and nothing moves, nothing will touch.
    near_up, near_down = _neighbours(upper, up), _neighbours(lower, down)
    for _ in range(rounds):
        above, below = (
            above + _spread_corrections(upper, up),
            below + _spread_corrections(lower, down),
        )
        up = _corrections(upper, above, lower, below, near_up)
        down = _corrections(lower, below, upper, above, near_down)
        if not (up.any() or down.any()):
            break
    moved = np.zeros_like(vertices)
    moved[upper.vertices] = above - places[0]
    moved[lower.vertices] = below - places[1]
    return moved


def separate_lips(
    generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
) -> Float[Array, "52 v 3"]:
    """The units with lips that are not in each other at weight 1.

    mouthClose is made for an open jaw and is corrected together with jawOpen.

    Args:
        vertices: (V, 3) mm, the neutral face.
        units: (52, V, 3) mm.
    """
    lips = Lips.of(generic, vertices)
    result = np.asarray(units, np.float64).copy()
    jaw, close = (generic.unit_names.index(name) for name in ("jawOpen", "mouthClose"))
    for unit in [jaw, *(other for other in range(len(result)) if other != jaw)]:
        posed = vertices + result[unit]
        if unit == close:
            posed = posed + result[jaw]
        result[unit] += _separated(lips, posed) - posed
    return result


def _separated(lips: Lips, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
    """(V, 3) mm with lips that are not in each other, however long that takes."""
    for _ in range(_ROUNDS):
        moved = resolve_lips(lips, vertices, rounds=4 * _ROUNDS)
        if moved is None:
            break
        vertices = vertices + moved
    return vertices


def _lip(
    generic: GenericHead, edges: csr_matrix, distance: Float[Array, " v"], upwards: float
) -> Lip:
    """The lip of the vertices within reach of its inner edge."""
    mesh = generic.mesh
    skin = mesh.triangles[mesh.triangles_of("skin")]
    inside = (distance < _PATCH_MM)[skin].all(axis=1)
    vertices = np.unique(skin[inside])
    index = np.full(len(distance), -1)
    index[vertices] = np.arange(len(vertices))
    triangles = index[skin[inside]].astype(np.int64)
    tested = np.flatnonzero(distance[vertices] < _TESTED_MM)
    return Lip(
        vertices=frozen(vertices),
        triangles=frozen(triangles),
        border=frozen(np.isin(vertices, skin[~inside])),
        tested=frozen(tested),
        spread=frozen(_spread_weights(edges, vertices, tested)),
        allowed=frozen(np.zeros(len(tested))),
        upwards=upwards,
    )


def _spread_weights(
    edges: csr_matrix, vertices: Int[Array, " p"], tested: Int[Array, " t"]
) -> Float[Array, "p t"]:
    from scipy.sparse.csgraph import dijkstra

    along = dijkstra(edges[vertices][:, vertices], indices=tested, limit=_SPREAD_MM)
    return cosine_falloff(along.T, _SPREAD_MM)


def _allowing(lip: Lip, depth: Float[Array, " t"]) -> Lip:
    return replace(lip, allowed=frozen(depth))


def _depths(upper: Lip, lower: Lip, vertices: Float[Array, "v 3"]) -> tuple[Array, Array]:
    above, below = vertices[upper.vertices], vertices[lower.vertices]
    return (
        _penetration(above[upper.tested], lower, below)[0],
        _penetration(below[lower.tested], upper, above)[0],
    )


def _penetration(
    points: Float[Array, "n 3"], lip: Lip, places: Float[Array, "p 3"]
) -> tuple[Array, Array, Array]:
    """Depth of points in a lip whose vertices are at these places, and the nearest places on it."""
    return penetration_depths(points, places, lip.triangles, lip.border, _DEEPEST_MM)


def _corrections(
    lip: Lip,
    places: Float[Array, "p 3"],
    other: Lip,
    others: Float[Array, "q 3"],
    among: Int[Array, " n"] | None = None,
) -> Float[Array, "t 3"]:
    """(T, 3) mm by which the tested vertices (only those `among` them) give way."""
    corrections = np.zeros((len(lip.tested), 3))
    among = np.arange(len(lip.tested)) if among is None else among
    points = places[lip.tested[among]]
    depth, triangle, weights = _penetration(points, other, others)
    deep = np.flatnonzero(depth - lip.allowed[among] > _TOLERANCE_MM)
    if not len(deep):
        return corrections
    corners = others[other.triangles[triangle[deep]]]
    nearest = (weights[deep][..., None] * corners).sum(axis=1)
    rise = lip.upwards * (nearest - points[deep])[:, 1] / depth[deep]
    excess = depth[deep] - lip.allowed[among[deep]]
    corrections[among[deep], 1] = lip.upwards * _STEP * excess / np.maximum(rise, _STEEPEST)
    return corrections


def _neighbours(lip: Lip, corrections: Float[Array, "t 3"]) -> Int[Array, " n"]:
    """The tested vertices that go along with those that give way."""
    hit = corrections.any(axis=1)
    return np.flatnonzero(lip.spread[np.ix_(lip.tested, hit)].any(axis=1))


def _spread_corrections(lip: Lip, corrections: Float[Array, "t 3"]) -> Float[Array, "p 3"]:
    """(P, 3) the weighted mean of the corrections around, fading where there are none."""
    chosen = np.flatnonzero(corrections.any(axis=1))
    if not len(chosen):
        return np.zeros((len(lip.vertices), 3))
    near = lip.spread[:, chosen]
    most = near.max(axis=1)
    share = most / np.maximum(near.sum(axis=1), 1e-12)
    return (near @ corrections[chosen]) * share[:, None]


def close_lips(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
    """The head with lips that meet, half of the gap from either side; an open mouth stays open.

    The generic head's lips are apart by a hair at the corners, and what a photo shows of closed
    lips is one line. They move up and down alone: one lip may lie before the other.

    Args:
        vertices: (V, 3) mm.
    """
    edges = skin_edges(generic, generic.mesh.vertices)
    lines = [
        shortest_path(edges, generic.polylines[f"{which}_lip_inner"])
        for which in ("upper", "lower")
    ]
    upper, lower = (vertices[line] for line in lines)
    middle = np.array([0.5])
    if (_points_along(upper, middle) - _points_along(lower, middle))[0, 1] > CLOSED_MM:
        return vertices
    sources = np.concatenate([lines[0], lines[1][1:-1]])
    moves = np.concatenate([_halfway(upper, lower), _halfway(lower, upper)[1:-1]])
    distance, nearest = geodesic_distances(edges, sources)
    carried = np.zeros_like(vertices)
    index: Int[Array, " v"] = np.full(len(vertices), -1)
    index[sources] = np.arange(len(sources))
    near = np.flatnonzero(distance < _CLOSING_SPREAD_MM)
    carried[near] = (
        cosine_falloff(distance[near], _CLOSING_SPREAD_MM)[:, None] * moves[index[nearest[near]]]
    )
    return vertices + carried


def _halfway(line: Float[Array, "n 3"], other: Float[Array, "m 3"]) -> Float[Array, "n 3"]:
    """(N, 3) mm up or down from each vertex of a lip's edge to halfway to the other lip's."""
    gap = (_points_along(other, _arc_fractions(line)) - line)[:, 1]
    share = np.clip((_OPEN_MM - np.abs(gap)) / (_OPEN_MM - CLOSED_MM), 0, 1)
    return np.outer(gap / 2 * share, [0.0, 1.0, 0.0])


def _arc_fractions(line: Float[Array, "n 3"]) -> Float[Array, " n"]:
    """From 0 to 1 by the length along a line."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    return length / max(float(length[-1]), 1e-9)


def _points_along(line: Float[Array, "n 3"], fractions: Float[Array, " m"]) -> Float[Array, "m 3"]:
    at = _arc_fractions(line)
    return np.column_stack([np.interp(fractions, at, line[:, axis]) for axis in range(3)])
