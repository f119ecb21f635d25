"""Texture coordinates: hm08's own islands, packed anew so that the head fills the square."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.special import erf

from mien.arrays import Array, Float, Int
from tools.assets.head import PART_NAMES, HeadCut
from tools.assets.makehuman import MakeHuman

Rectangle = tuple[float, float, float, float]

# Where each part's islands go (u0, v0, u1, v1), the largest island in hm08's atlas first.
_TILES: dict[str, tuple[Rectangle, ...]] = {
    # head, front of the neck, mouth cavity, right and left eye socket
    "skin": (
        (0.00, 0.30, 1.00, 1.00),
        (0.00, 0.00, 0.30, 0.15),
        (0.00, 0.15, 0.17, 0.30),
        (0.30, 0.00, 0.36, 0.075),
        (0.30, 0.075, 0.36, 0.15),
    ),
    # front and back
    "left_eyeball": ((0.17, 0.15, 0.30, 0.30), (0.36, 0.00, 0.43, 0.15)),
    "right_eyeball": ((0.30, 0.15, 0.43, 0.30), (0.43, 0.00, 0.50, 0.15)),
    "upper_teeth": ((0.50, 0.00, 0.64, 0.075),),
    "lower_teeth": ((0.50, 0.075, 0.64, 0.15),),
    "tongue": ((0.43, 0.15, 0.50, 0.30),),
    "lashes": (
        (0.50, 0.15, 0.57, 0.225),
        (0.57, 0.15, 0.64, 0.225),
        (0.50, 0.225, 0.57, 0.30),
        (0.57, 0.225, 0.64, 0.30),
    ),
    "hair": ((0.64, 0.00, 1.00, 0.30),),
}
_MARGIN = 0.003
# How the head's island is stretched so that the face gets more of it: centre and width of the
# stretched band, in the island's box, and the gain.
_WIDE = (0.5, 0.14, 1.8)
_TALL = (0.27, 0.22, 1.0)


def pack(source: MakeHuman, head: HeadCut) -> tuple[Float[Array, "u 2"], Int[Array, "q 4"]]:
    """Texture coordinates of the head.

    Returns:
        (U, 2) in [0, 1], and for each quad its (Q, 4) indices into them.
    """
    uvs, uv_quads = [], np.empty_like(head.uv_quads)
    count = 0
    for index, part in enumerate(PART_NAMES):
        chosen = np.flatnonzero(head.quad_part == index)
        used, local = np.unique(head.uv_quads[chosen], return_inverse=True)
        local = local.reshape(-1, 4)
        placed = source.uvs[used].copy()
        islands = _islands(placed, local)
        for rank, (island, tile) in enumerate(zip(islands, _TILES[part], strict=True)):
            unit = _to_unit_square(placed[island])
            if rank == 0 and part in ("skin", "hair"):
                # The head lies on its side in hm08's atlas: turned, so that up is up.
                unit = np.column_stack([unit[:, 1], 1 - unit[:, 0]])
            if rank == 0 and part == "skin":
                unit = np.column_stack(
                    [_magnified(unit[:, 0], *_WIDE), _magnified(unit[:, 1], *_TALL)]
                )
            placed[island] = np.add(tile[:2], _MARGIN) + unit * (
                np.subtract(tile[2:], tile[:2]) - 2 * _MARGIN
            )
        uvs.append(placed)
        uv_quads[chosen] = local + count
        count += len(used)
    return np.concatenate(uvs), uv_quads


def _islands(uvs: Float[Array, "u 2"], quads: Int[Array, "q 4"]) -> list[Int[Array, " n"]]:
    """Connected sets of texture vertices, the largest box first."""
    a, b = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(uvs), len(uvs)))
    _, label = connected_components(graph, directed=False)
    islands = [np.flatnonzero(label == k) for k in range(label.max() + 1)]
    return sorted(islands, key=lambda i: (-round(float(np.prod(np.ptp(uvs[i], 0))), 5), i[0]))


def _to_unit_square(uvs: Float[Array, "n 2"]) -> Float[Array, "n 2"]:
    return (uvs - uvs.min(0)) / np.ptp(uvs, axis=0)


def _magnified(x: Float[Array, " n"], centre: float, width: float, gain: float) -> Array:
    """A smooth rising map of [0, 1] onto itself, 1 + gain times as steep about the centre."""
    bump = gain * width * np.sqrt(np.pi) / 2

    def integral(t: Array) -> Array:
        return np.asarray(t + bump * erf((t - centre) / width))

    ends = integral(np.array([0.0, 1.0]))
    return np.asarray((integral(x) - ends[0]) / (ends[1] - ends[0]))
