"""The generic head: the mesh that every person's head is a deformation of."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array, frozen
from mien.errors import FileFormatError, InputError
from mien.mesh import Mesh


@dataclass(frozen=True)
class IdentityBasis:
    """Linear model of identity: vertices = generic + coefficients . components.

    Attributes:
        components: (K, V, 3) mm, scaled so that a person's coefficients are independent with mean 0
            and standard deviation 1: half the sum of their squares is the negative log prior.
    """

    components: Float[Array, "k v 3"]

    def offsets(self, coefficients: Float[Array, " k"]) -> Float[Array, "v 3"]:
        """(V, 3) mm to add to the generic head's vertices.

        Raises:
            InputError: more coefficients than components, or not finite; fewer are fine.
        """
        coefficients = check_array("coefficients", coefficients, (None,))
        if len(coefficients) > len(self.components):
            expected = f"at most {len(self.components)} numbers"
            raise InputError("coefficients", expected, f"{len(coefficients)}")
        used = self.components[: len(coefficients)]
        return np.tensordot(coefficients, used, axes=1)


@dataclass(frozen=True)
class GenericHead:
    """The generic head with its face units, identity model, regions and landmarks.

    Attributes:
        mesh: head space, scaled to an interpupillary distance of 63 mm.
        mirror: (V,) index of each vertex's left-right partner (its own on the midline).
        unit_names: the 52 ARKit names, sorted.
        unit_offsets: (52, V, 3) mm, added to the vertices at weight 1.
        identity: linear model of other heads.
        regions: soft masks by name, (V,) in [0, 1].
        points: [Pighin 2002]'s 13 points: vertex index by name.
        polylines: vertex indices along each feature curve, by name.
        landmark_triangles: (478,) index of the triangle under each detector landmark.
        landmark_barycentrics: (478, 3) position in it.
        landmark_attached: (478,) False where the detector's point is not on the mesh.
    """

    mesh: Mesh
    mirror: Int[Array, " v"]
    unit_names: tuple[str, ...]
    unit_offsets: Float[Array, "52 v 3"]
    identity: IdentityBasis
    regions: dict[str, Float[Array, " v"]]
    points: dict[str, int]
    polylines: dict[str, tuple[int, ...]]
    landmark_triangles: Int[Array, " 478"]
    landmark_barycentrics: Float[Array, "478 3"]
    landmark_attached: Bool[Array, " 478"]

    @property
    def feature_names(self) -> tuple[str, ...]:
        """The 13 points, then every vertex of a polyline as POLYLINE.INDEX."""
        on_lines = (
            f"{name}.{index}" for name, line in self.polylines.items() for index in range(len(line))
        )
        return (*self.points, *on_lines)

    def vertex_of(self, name: str) -> int:
        """The vertex of one of the 13 points or of POLYLINE.INDEX.

        Raises:
            InputError: no such name; lists those that are close.
        """
        if name in self.points:
            return self.points[name]
        polyline, _, index = name.rpartition(".")
        line = self.polylines.get(polyline, ())
        if index.isascii() and index.isdigit() and int(index) < len(line):
            return line[int(index)]
        close = difflib.get_close_matches(name, self.feature_names, n=3)
        expected = "a feature's name"
        if close:
            expected += f" such as {', '.join(close)}"
        raise InputError("feature", expected, name)

    def landmark_positions(self, vertices: Float[Array, "v 3"]) -> Float[Array, "478 3"]:
        """The detector's landmarks on a head with these vertices, (V, 3) to (478, 3) mm.

        Rows where landmark_attached is False are approximate.

        Raises:
            InputError: wrong shape.
        """
        vertices = check_array("vertices", vertices, self.mesh.vertices.shape)
        corners = vertices[self.mesh.triangles[self.landmark_triangles]]
        return (corners * self.landmark_barycentrics[..., None]).sum(axis=1)


@cache
def load_generic_head() -> GenericHead:
    """The generic head that ships with mien, read once and kept.

    Raises:
        FileFormatError: the installation is incomplete.
    """
    path = Path(str(files("mien.assets"))) / "data" / "generic_head.npz"
    if not path.is_file():
        raise FileFormatError(path, "expected the generic head here; reinstall mien")
    with np.load(path, allow_pickle=False) as stored:
        data = {key: stored[key] for key in stored.files}
    return GenericHead(
        mesh=_mesh(data),
        mirror=frozen(data["mirror"].astype(np.int64)),
        unit_names=_strings(data["unit_names"]),
        unit_offsets=frozen(_unit_offsets(data)),
        identity=IdentityBasis(frozen(data["identity_components"].astype(np.float32))),
        regions=dict(
            zip(_strings(data["region_names"]), map(frozen, data["regions"]), strict=True)
        ),
        points=dict(zip(_strings(data["point_names"]), data["points"].tolist(), strict=True)),
        polylines=_polylines(data),
        landmark_triangles=frozen(data["landmark_triangles"].astype(np.int64)),
        landmark_barycentrics=frozen(data["landmark_barycentrics"].astype(np.float64)),
        landmark_attached=frozen(data["landmark_attached"]),
    )


def _strings(names: Array) -> tuple[str, ...]:
    return tuple(str(name) for name in names)


def _mesh(data: dict[str, Array]) -> Mesh:
    return Mesh(
        vertices=data["vertices"],
        triangles=data["triangles"],
        uvs=data["uvs"],
        uv_triangles=data["uv_triangles"],
        part=data["part"],
        part_names=_strings(data["part_names"]),
    )


def _unit_offsets(data: dict[str, Array]) -> Float[Array, "52 v 3"]:
    """The units are stored as the vertices that each moves."""
    counts = data["unit_counts"]
    offsets = np.zeros((len(counts), len(data["vertices"]), 3), np.float32)
    units = np.repeat(np.arange(len(counts)), counts)
    offsets[units, data["unit_vertices"]] = data["unit_offsets"]
    return offsets


def _polylines(data: dict[str, Array]) -> dict[str, tuple[int, ...]]:
    """The polylines are stored end to end."""
    ends = np.cumsum(data["polyline_lengths"], dtype=np.int64)[:-1]
    lines = np.split(data["polyline_vertices"], ends)
    names = _strings(data["polyline_names"])
    return {name: tuple(line.tolist()) for name, line in zip(names, lines, strict=True)}
