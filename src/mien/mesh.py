"""A triangle mesh with parts and texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, check_array, frozen
from mien.errors import InputError


@dataclass(frozen=True)
class Mesh:
    """Triangles over vertices, counter-clockwise seen from outside.

    Attributes:
        vertices: (V, 3) mm, head space.
        triangles: (F, 3) vertex indices.
        uvs: (U, 2) texture coordinates in [0, 1], v upwards, origin at the bottom left.
        uv_triangles: (F, 3) indices into uvs.
        part: (F,) index into part_names for every triangle.
        part_names: for example ("skin", "left_eyeball", ...).

    Raises:
        InputError: shapes that do not fit, an index out of range.
    """

    vertices: Float[Array, "v 3"]
    triangles: Int[Array, "f 3"]
    uvs: Float[Array, "u 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    uv_triangles: Int[Array, "f 3"] = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    part: UInt8[Array, " f"] = field(default_factory=lambda: np.zeros(0, np.uint8))
    part_names: tuple[str, ...] = ("skin",)

    def __post_init__(self) -> None:
        vertices = check_array("vertices", self.vertices, (None, 3))
        triangles = _check_indices("triangles", self.triangles, len(vertices))
        faces = len(triangles)
        uvs = check_array("uvs", self.uvs, (None, 2))
        uv_triangles = _check_indices("uv_triangles", self.uv_triangles, len(uvs))
        if len(uv_triangles) not in (0, faces):
            raise InputError("uv_triangles", f"0 or {faces} triangles", len(uv_triangles))
        part = np.zeros(faces, np.uint8) if len(self.part) == 0 else self.part
        part = check_array("part", part, (faces,), dtype=np.uint8)
        if faces and part.max() >= len(self.part_names):
            raise InputError("part", f"indices below {len(self.part_names)}", part.max())
        for name, array in (
            ("vertices", vertices),
            ("triangles", triangles),
            ("uvs", uvs),
            ("uv_triangles", uv_triangles),
            ("part", part),
        ):
            object.__setattr__(self, name, frozen(array))

    def with_vertices(self, vertices: Float[Array, "v 3"]) -> Mesh:
        """The same topology over other vertex positions, (V, 3) mm."""
        return replace(self, vertices=check_array("vertices", vertices, self.vertices.shape))

    def triangles_of(self, *parts: str) -> Int[Array, " f"]:
        """Indices of the triangles of the named parts. Raises: InputError: no such part."""
        unknown = [name for name in parts if name not in self.part_names]
        if unknown:
            raise InputError("part", " or ".join(self.part_names), unknown[0])
        return np.flatnonzero(np.isin(self.part, [self.part_names.index(name) for name in parts]))

    def vertices_of(self, *parts: str) -> Int[Array, " n"]:
        """Indices of the named parts' vertices, ascending. Raises: InputError: no such part."""
        return np.unique(self.triangles[self.triangles_of(*parts)])

    def submesh(self, triangles: Int[Array, " f"]) -> Mesh:
        """The same vertices with only the given triangles (by index)."""
        has_uvs = len(self.uv_triangles) > 0
        return replace(
            self,
            triangles=self.triangles[triangles],
            uv_triangles=self.uv_triangles[triangles] if has_uvs else self.uv_triangles,
            part=self.part[triangles],
        )

    def triangle_normals(self) -> Float[Array, "f 3"]:
        """Outward normals, length twice the triangle's area (mm^2)."""
        a, b, c = (self.vertices[self.triangles[:, corner]] for corner in range(3))
        return np.cross(b - a, c - a)

    def vertex_normals(self) -> Float[Array, "v 3"]:
        """Outward unit normals, area-weighted; zero at a vertex that no triangle uses."""
        normals = np.zeros_like(self.vertices)
        faces = self.triangle_normals()
        for corner in range(3):
            np.add.at(normals, self.triangles[:, corner], faces)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)


def _check_indices(name: str, value: object, limit: int) -> Int[Array, "f 3"]:
    indices = check_array(name, value, (None, 3), dtype=np.int32)
    if indices.size and not (indices.min() >= 0 and indices.max() < limit):
        raise InputError(
            name, f"indices from 0 to {limit - 1}", f"{indices.min()} to {indices.max()}"
        )
    return indices
