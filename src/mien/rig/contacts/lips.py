"""Lips: closing of a closed mouth, and contacts of the two lips."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.generic import GenericHead
from mien.numeric.signed_distance import penetration_depths
from mien.rig.skin_paths import cosine_falloff, geodesic_distances, shortest_path, skin_edges

_PATCH_MM = 14.0
"""Skin this near to the line where the lips meet is lip, front and back."""
_TESTED_MM = 8.0
_SPREAD_MM = 6.0
"""Distance at which the correction of a vertex has faded out."""
_DEEPEST_MM = 6.0
_TOLERANCE_MM = 0.05
_STEP = 0.6
"""Share of its depth by which a vertex moves in an iteration; the other lip does too."""
_MIN_RISE = 0.5
"""The vertical way out is at most twice as long as the nearest one."""
_ROUNDS = 4
CLOSED_MM = 2.0
"""Largest gap in the middle of a closed mouth."""
_OPEN_MM = 4.0
"""Gap from which on the lips of a closed mouth are not moved."""
_CLOSING_SPREAD_MM = 7.0


@dataclass(frozen=True)
class Lip:
    """The upper or the lower lip, from its skin around the red to its back.

    Attributes:
        vertices: (P,) of the mesh.
        triangles: (F, 3) into them.
        border: (P,) whether a vertex is on its boundary.
        tested: (T,) vertices that can penetrate the other lip.
        spread: (P, T) weights of the correction of a tested vertex; 1 at itself.
        allowed: (T,) mm, penetration of the neutral face.
        upwards: direction of corrections: 1 for the upper lip, -1 for the lower.
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
        """For a head with these neutral vertices, (V, 3) mm, whose penetration is allowed."""
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
        """(T,) mm by which the tested vertices penetrate the other lip; 0 outside."""
        return np.concatenate(_depths(self.upper, self.lower, vertices))

    @property
    def allowed(self) -> Float[Array, " t"]:
        """(T,) mm, penetration of the neutral face."""
        return np.concatenate([self.upper.allowed, self.lower.allowed])


def resolve_lips(
    lips: Lips, vertices: Float[Array, "v 3"], *, rounds: int = _ROUNDS
) -> Float[Array, "v 3"] | None:
    """(V, 3) mm that takes the lips out of each other; None without contact.

    In every iteration penetrating vertices of the upper lip move up and those of the lower lip
    down, and the skin around follows. (The nearest way out may lead through the front of the other
    lip.)
    """
    upper, lower = lips.upper, lips.lower
    above, below = before = vertices[upper.vertices], vertices[lower.vertices]
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
    moved[upper.vertices] = above - before[0]
    moved[lower.vertices] = below - before[1]
    return moved


def separate_lips(
    generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
) -> Float[Array, "52 v 3"]:
    """The units with lips that do not penetrate each other at weight 1.

    mouthClose is made for an open jaw and is corrected together with jawOpen.

    Args:
        generic: its topology and unit names.
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
    """(V, 3) mm with lips that do not penetrate each other."""
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
    points: Float[Array, "n 3"], lip: Lip, vertices: Float[Array, "p 3"]
) -> tuple[Array, Array, Array]:
    """Penetration of points in a lip with these vertices, and the nearest points on it."""
    return penetration_depths(points, vertices, lip.triangles, lip.border, _DEEPEST_MM)


def _corrections(
    lip: Lip,
    vertices: Float[Array, "p 3"],
    other: Lip,
    others: Float[Array, "q 3"],
    among: Int[Array, " n"] | None = None,
) -> Float[Array, "t 3"]:
    """(T, 3) mm by which the tested vertices (only those `among` them) move out."""
    corrections = np.zeros((len(lip.tested), 3))
    among = np.arange(len(lip.tested)) if among is None else among
    points = vertices[lip.tested[among]]
    depth, triangle, weights = _penetration(points, other, others)
    deep = np.flatnonzero(depth - lip.allowed[among] > _TOLERANCE_MM)
    if not len(deep):
        return corrections
    corners = others[other.triangles[triangle[deep]]]
    nearest = (weights[deep][..., None] * corners).sum(axis=1)
    rise = lip.upwards * (nearest - points[deep])[:, 1] / depth[deep]
    excess = depth[deep] - lip.allowed[among[deep]]
    corrections[among[deep], 1] = lip.upwards * _STEP * excess / np.maximum(rise, _MIN_RISE)
    return corrections


def _neighbours(lip: Lip, corrections: Float[Array, "t 3"]) -> Int[Array, " n"]:
    """The tested vertices that the corrections reach."""
    hit = corrections.any(axis=1)
    return np.flatnonzero(lip.spread[np.ix_(lip.tested, hit)].any(axis=1))


def _spread_corrections(lip: Lip, corrections: Float[Array, "t 3"]) -> Float[Array, "p 3"]:
    """(P, 3) the weighted mean of the corrections around, fading with distance."""
    chosen = np.flatnonzero(corrections.any(axis=1))
    if not len(chosen):
        return np.zeros((len(lip.vertices), 3))
    near = lip.spread[:, chosen]
    most = near.max(axis=1)
    share = most / np.maximum(near.sum(axis=1), 1e-12)
    return (near @ corrections[chosen]) * share[:, None]


def close_lips(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
    """The head with lips that meet halfway; an open mouth stays open.

    The generic head's lips are slightly apart at the corners, while photos show closed lips as one
    line. Only heights change: one lip may lie in front of the other.

    Args:
        generic: its topology.
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
    offsets = np.zeros_like(vertices)
    index: Int[Array, " v"] = np.full(len(vertices), -1)
    index[sources] = np.arange(len(sources))
    near = np.flatnonzero(distance < _CLOSING_SPREAD_MM)
    offsets[near] = (
        cosine_falloff(distance[near], _CLOSING_SPREAD_MM)[:, None] * moves[index[nearest[near]]]
    )
    return vertices + offsets


def _halfway(line: Float[Array, "n 3"], other: Float[Array, "m 3"]) -> Float[Array, "n 3"]:
    """(N, 3) mm up or down from each vertex of a lip's edge to halfway to the other lip's."""
    gap = (_points_along(other, _arc_fractions(line)) - line)[:, 1]
    share = np.clip((_OPEN_MM - np.abs(gap)) / (_OPEN_MM - CLOSED_MM), 0, 1)
    return np.outer(gap / 2 * share, [0.0, 1.0, 0.0])


def _arc_fractions(line: Float[Array, "n 3"]) -> Float[Array, " n"]:
    """Normalized arc length of the vertices of a line, 0 to 1."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    return length / max(float(length[-1]), 1e-9)


def _points_along(line: Float[Array, "n 3"], fractions: Float[Array, " m"]) -> Float[Array, "m 3"]:
    at = _arc_fractions(line)
    return np.column_stack([np.interp(fractions, at, line[:, axis]) for axis in range(3)])
