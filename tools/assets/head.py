"""Cuts the head out of MakeHuman's body: its parts, mean shape, head space and pairing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from tools.assets.makehuman import MakeHuman
from tools.assets.topology import QuadTopology

IPD_MM = 63.0
PART_NAMES = (
    "skin",
    "left_eyeball",
    "right_eyeball",
    "upper_teeth",
    "lower_teeth",
    "tongue",
    "lashes",
    "hair",
)
_HELPERS = {
    "left_eyeball": ("helper-l-eye",),
    "right_eyeball": ("helper-r-eye",),
    "upper_teeth": ("helper-upper-teeth",),
    "lower_teeth": ("helper-lower-teeth",),
    "tongue": ("helper-tongue",),
    "lashes": tuple(f"helper-{side}-eyelashes-{row}" for side in "lr" for row in "12"),
}
# Between which heights the loop around the neck lies where the head is cut off, on hm08.
_NECK_HEIGHT_DM = (5.55, 6.0)


@dataclass(frozen=True)
class HeadCut:
    """The part of hm08 that becomes the generic head, as quads.

    Attributes:
        source: (V,) hm08 vertex under every vertex of the head; parts follow each other.
        quads: (Q, 4) indices into the head's vertices and into hm08's texture vertices.
        uv_quads: as `quads`.
        quad_part: (Q,) index into PART_NAMES.
        mirror: (V,) left-right partner.
        vertices: (V, 3) mm, head space: the mean shape.
        mm_per_dm: scale from hm08's decimetres.
    """

    source: Int[Array, " v"]
    quads: Int[Array, "q 4"]
    uv_quads: Int[Array, "q 4"]
    quad_part: Int[Array, " q"]
    mirror: Int[Array, " v"]
    vertices: Float[Array, "v 3"]
    mm_per_dm: float

    def offsets_mm(self, offsets_dm: Float[Array, "m 3"]) -> Float[Array, "v 3"]:
        """A target's offsets on hm08 as offsets of the head's vertices."""
        return offsets_dm[self.source] * self.mm_per_dm

    def from_hm08(self, vertices: Iterable[int]) -> list[int]:
        """The head's vertices that were these hm08 vertices (not their copies in the hair)."""
        places: dict[int, int] = {}
        for index, vertex in enumerate(self.source.tolist()):
            places.setdefault(vertex, index)
        return [places[vertex] for vertex in vertices]

    def vertices_of(self, part: str) -> Int[Array, " n"]:
        """Vertices of a part."""
        return np.unique(self.quads[self.quad_part == PART_NAMES.index(part)])


def cut_head(source: MakeHuman) -> HeadCut:
    """The head in its mean shape, without hair."""
    vertices, quads, uv_quads, quad_part = [], [], [], []
    count = 0
    for index, part in enumerate(PART_NAMES[:-1]):
        if part == "skin":
            part_quads, part_uvs = _above_neck(source)
        else:
            part_quads, part_uvs = source.quads(*_HELPERS[part])
        used, local = np.unique(part_quads, return_inverse=True)
        vertices.append(used)
        quads.append(local.reshape(-1, 4) + count)
        uv_quads.append(part_uvs)
        quad_part.append(np.full(len(part_quads), index))
        count += len(used)
    chosen = np.concatenate(vertices)
    place = np.full(len(source.vertices), -1)
    place[chosen] = np.arange(count)
    mirror = place[source.mirror[chosen]]
    shape = mean_shape(source)[chosen]
    shape = (shape + shape[mirror] * [-1, 1, 1]) / 2
    left, right = (
        shape[np.isin(chosen, np.unique(source.quads(f"helper-{side}-eye")[0]))].mean(0)
        for side in "lr"
    )
    mm_per_dm = IPD_MM / float(np.linalg.norm(left - right))
    return HeadCut(
        source=chosen,
        quads=np.concatenate(quads),
        uv_quads=np.concatenate(uv_quads),
        quad_part=np.concatenate(quad_part),
        mirror=mirror,
        vertices=(shape - (left + right) / 2) * mm_per_dm,
        mm_per_dm=mm_per_dm,
    )


def mean_shape(source: MakeHuman) -> Float[Array, "v 3"]:
    """(V, 3) dm: an even mix of MakeHuman's young averages, as its macro weights would mix them.

    The raw base mesh is no person's shape: it is what the targets are added to.
    """
    vertices = source.vertices.copy()
    for gender in ("female", "male"):
        for ancestry in ("african", "asian", "caucasian"):
            vertices += source.target(f"macrodetails/{ancestry}-{gender}-young") / 6
        name = f"macrodetails/universal-{gender}-young-averagemuscle-averageweight"
        vertices += source.target(name) / 2
    return vertices


def _above_neck(source: MakeHuman) -> tuple[Int[Array, "q 4"], Int[Array, "q 4"]]:
    """Body quads above a closed edge loop around the neck, so that the cut is a clean ring."""
    quads, uv_quads = source.quads("body")
    topology = QuadTopology(quads)
    loop = _neck_loop(source.vertices, topology)
    walls = {frozenset(pair) for pair in zip(loop, loop[1:] + loop[:1], strict=True)}
    top = int(np.argmax(source.vertices[quads][:, :, 1].mean(1)))
    kept = topology.flood(top, walls)
    return quads[kept], uv_quads[kept]


def _neck_loop(vertices: Float[Array, "v 3"], topology: QuadTopology) -> list[int]:
    """The lowest closed loop around the neck within _NECK_HEIGHT_DM."""
    low, high = _NECK_HEIGHT_DM
    edges = [sorted(edge) for edge in topology.faces_of]
    for a, b in sorted(edges, key=lambda edge: (min(vertices[edge, 1]), edge)):
        if min(vertices[[a, b], 1]) > low:
            loop = topology.edge_loop(a, b)
            heights = vertices[loop, 1]
            if len(loop) > 30 and heights.min() > low and heights.max() < high:
                return loop
    raise ValueError("hm08: no closed loop around the neck")
