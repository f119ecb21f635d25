"""Splits quads into triangles so that the two halves of the head are exact mirror images."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int

_DIAGONALS = (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0)))


def triangulate(
    quads: Int[Array, "q 4"], mirror: Int[Array, " v"], vertices: Float[Array, "v 3"]
) -> Int[Array, "f 3"]:
    """Corners (within its quad) of two triangles for every quad, each quad's beside each other.

    The shorter diagonal is taken, except where it would fold the quad over itself. A quad whose
    mirror image comes earlier takes that one's diagonal.

    Returns:
        (2 Q, 3) corner numbers 0..3; row i belongs to quad i // 2.
    """
    second = _prefers_second(vertices[quads])
    place = {frozenset(quad): index for index, quad in enumerate(quads.tolist())}
    corners = np.empty((len(quads), 2, 3), np.int64)
    for index, quad in enumerate(quads):
        partner = place[frozenset(mirror[quad].tolist())]
        choice = second[index]
        if partner < index:
            diagonal = quads[partner][_DIAGONALS[second[partner]][0][::2],]
            choice = int(quad[0] not in mirror[diagonal])
            second[index] = choice
        corners[index] = _DIAGONALS[choice]
    return corners.reshape(-1, 3)


def _prefers_second(corners: Float[Array, "q 4 3"]) -> Int[Array, " q"]:
    """1 where the diagonal from corner 1 to 3 is better than that from 0 to 2."""
    lengths = [np.linalg.norm(corners[:, a] - corners[:, a + 2], axis=1) for a in (0, 1)]
    folds = [_agreement(corners, pair) < 0 for pair in _DIAGONALS]
    second = np.where(folds[0] == folds[1], lengths[1] < lengths[0], folds[0])
    return second.astype(np.int64)


def _agreement(
    corners: Float[Array, "q 4 3"], pair: tuple[tuple[int, ...], tuple[int, ...]]
) -> Float[Array, " q"]:
    """Product of the two triangles' normals: negative where the quad folds over."""
    normals = [
        np.cross(
            corners[:, t[1]] - corners[:, t[0]],
            corners[:, t[2]] - corners[:, t[0]],
        )
        for t in pair
    ]
    return (normals[0] * normals[1]).sum(1)


def vertex_normals(vertices: Float[Array, "v 3"], quads: Int[Array, "q 4"]) -> Float[Array, "v 3"]:
    """Outward unit normals from the quads' diagonals; zero at a vertex that no quad uses."""
    across = np.cross(
        vertices[quads[:, 2]] - vertices[quads[:, 0]], vertices[quads[:, 3]] - vertices[quads[:, 1]]
    )
    normals = np.zeros_like(vertices)
    for corner in range(4):
        np.add.at(normals, quads[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
