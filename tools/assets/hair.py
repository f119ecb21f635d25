"""Where hair grows, and a cap of hair over it.

MakeHuman's own hair helper is a set of long strips that hang over the face, so the cap is made
here: the scalp's skin, lifted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float
from tools.assets.features import HAIRLINE
from tools.assets.head import PART_NAMES, HeadCut
from tools.assets.triangles import vertex_normals

# Where hair ends behind the hairline: down the sideburn and around the ear (hm08 vertices on the
# subject's left), then at one height over the nape.
_BEHIND_TEMPLE = (7575, 12351, 12366, 12362, 12364, 7570, 11973, 7648, 7697, 12158, 11885)
_NAPE_HEIGHT_MM = -78.0
_SOFT_EDGE_MM = 12.0
_LIFT_MM = (0.8, 7.0)
# The middle of the skull, around which directions are counted.
_SKULL_Z_MM = -75.0


def scalp_mask(head: HeadCut) -> Float[Array, " v"]:
    """(V,) how much each vertex of the skin belongs to the haired part of the head, 0 to 1."""
    border = head.vertices[head.from_hm08(HAIRLINE + _BEHIND_TEMPLE)]
    angles = np.concatenate([_around(border), [np.pi]])
    heights = np.concatenate([border[:, 1], [_NAPE_HEIGHT_MM]])
    order = np.argsort(angles, kind="stable")
    edge = np.interp(_around(head.vertices), angles[order], heights[order])
    mask: Array = smoothstep((head.vertices[:, 1] - edge) / _SOFT_EDGE_MM + 0.5)
    mask[head.vertices_of("skin").max() + 1 :] = 0.0
    return mask


def add_hair(head: HeadCut, scalp: Float[Array, " v"]) -> HeadCut:
    """The head with a cap of hair: copies of the scalp's vertices, lifted along their normals."""
    skin = head.quad_part == PART_NAMES.index("skin")
    # Three of four corners: the edge follows the hairline with fewer notches than with all four.
    covered = np.flatnonzero(skin & ((scalp[head.quads] >= 0.5).sum(1) >= 3))
    below, local = np.unique(head.quads[covered], return_inverse=True)
    first = len(head.vertices)
    lift = np.interp(scalp[below], (0.5, 1.0), _LIFT_MM)
    normals = vertex_normals(head.vertices, head.quads[skin])
    copy = np.full(first, -1)
    copy[below] = first + np.arange(len(below))
    return replace(
        head,
        source=np.concatenate([head.source, head.source[below]]),
        quads=np.concatenate([head.quads, local.reshape(-1, 4) + first]),
        uv_quads=np.concatenate([head.uv_quads, head.uv_quads[covered]]),
        quad_part=np.concatenate([head.quad_part, np.full(len(covered), PART_NAMES.index("hair"))]),
        mirror=np.concatenate([head.mirror, copy[head.mirror[below]]]),
        vertices=np.concatenate(
            [head.vertices, head.vertices[below] + lift[:, None] * normals[below]]
        ),
    )


def smoothstep(x: Float[Array, " n"]) -> Float[Array, " n"]:
    """0 below 0, 1 above 1, a cubic in between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _around(vertices: Float[Array, "n 3"]) -> Float[Array, " n"]:
    """Angle from the front, 0 to pi, the same on both sides."""
    return np.arctan2(np.abs(vertices[:, 0]), vertices[:, 2] - _SKULL_Z_MM)
