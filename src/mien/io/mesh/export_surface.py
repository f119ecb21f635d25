"""What every exporter writes: the chosen parts by material, morph targets, normals, texture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, check_array
from mien.errors import InputError
from mien.head import NEUTRAL, Head
from mien.mesh import Mesh
from mien.render.shade import shown_parts

# Parts that share a material; a part that is not listed has one of its own name.
_MATERIALS = {
    "left_eyeball": "eyes",
    "right_eyeball": "eyes",
    "upper_teeth": "teeth",
    "lower_teeth": "teeth",
}
# How far each material scatters mirrored light (glTF's and USD's roughness, 0 to 1). The photos
# already carry the highlights that were there, so nothing is made as shiny as it is.
_ROUGHNESS = {"skin": 0.7, "eyes": 0.3, "teeth": 0.4, "tongue": 0.5}
_DEFAULT_ROUGHNESS = 0.9

# Smaller offsets are the residue of a transfer (mm); written out, they would make every morph
# target as large as the whole mesh.
_NEGLIGIBLE_MM = 1e-3


@dataclass(frozen=True)
class MaterialGroup:
    """The triangles that share a material, by index."""

    name: str
    triangles: Int[Array, " f"]

    @property
    def roughness(self) -> float:
        """0 (a mirror) to 1 (chalk)."""
        return _ROUGHNESS.get(self.name, _DEFAULT_ROUGHNESS)


@dataclass(frozen=True)
class MorphTarget:
    """Offsets in mm that are added at weight 1, for the vertices that move; these ascend."""

    name: str
    vertices: Int[Array, " n"]
    offsets: Float[Array, "n 3"]


@dataclass(frozen=True)
class ExportSurface:
    """The chosen parts of a head.

    Attributes:
        mesh: only what the parts use; neutral, mm, head space.
        groups: its triangles by material, in the order of the parts.
        normals: (V, 3) of length 1.
        targets: face units, then photographed expressions.
        textures: by name, neutral's first; none where the mesh has no coordinates in them.
        texture_of: which of them each photographed expression shows, neutral first.
    """

    mesh: Mesh
    groups: tuple[MaterialGroup, ...]
    normals: Float[Array, "v 3"]
    targets: tuple[MorphTarget, ...]
    textures: dict[str, UInt8[Array, "h w 3"]]
    texture_of: dict[str, str]

    @property
    def texture(self) -> UInt8[Array, "h w 3"] | None:
        """Neutral's."""
        return next(iter(self.textures.values()), None)


def export_surface(
    head: Head,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    shapes: Mapping[str, Float[Array, "v 3"]] | None = None,
) -> ExportSurface:
    """What to write of a head.

    Triangles that touch a vertex twice are left out.

    Args:
        head: the head.
        parts: names; by default those that pictures show, all but the hair cap and the lashes.
        units: with the face units.
        shapes: further morph targets: mm over the head's vertices.

    Raises:
        InputError: an unknown part, nothing left to export, a further target with the name or
            without the shape of the others.
    """
    offsets = morph_offsets(head, units=units)
    for name, shape in (shapes or {}).items():
        if name in offsets:
            raise InputError("shapes", "names that no other target has", name)
        offsets[name] = check_array(f"shape {name}", shape, head.mesh.vertices.shape)
    chosen = shown_parts(head.mesh) if parts is None else tuple(parts)
    triangles = _whole_triangles(head.mesh, chosen)
    mesh, kept = _compacted(head.mesh.submesh(triangles))
    materials = [_MATERIALS.get(name, name) for name in mesh.part_names]
    material = np.array(materials)[mesh.part]
    texture_of = _texture_of(head) if len(mesh.uv_triangles) else {}
    return ExportSurface(
        mesh=mesh,
        groups=tuple(
            MaterialGroup(name, np.flatnonzero(material == name))
            for name in dict.fromkeys(materials)
            if (material == name).any()
        ),
        normals=_unit_normals(mesh),
        targets=tuple(_target(name, all_[kept]) for name, all_ in offsets.items()),
        textures={name: head.textures[name] for name in dict.fromkeys(texture_of.values())},
        texture_of=texture_of,
    )


def morph_offsets(head: Head, *, units: bool = True) -> dict[str, Float[Array, "v 3"]]:
    """(V, 3) mm of each morph target: the face units, then the photographed expressions."""
    offsets = dict(zip(head.unit_names, head.units, strict=True)) if units else {}
    for name, expression in head.expressions.items():
        if name != NEUTRAL:
            offsets[expression_target_name(head, name)] = expression.vertices - head.mesh.vertices
    return offsets


def expression_target_name(head: Head, expression: str) -> str:
    """The name of an expression's morph target: its own, or NAME_photo where a unit has that."""
    return f"{expression}_photo" if expression in head.unit_names else expression


def split_at_seams(
    mesh: Mesh, triangles: Int[Array, " f"]
) -> tuple[Int[Array, " n"], Int[Array, " n"], Int[Array, "f 3"]]:
    """Corners for formats with one texture coordinate a vertex: vertices on seams are doubled.

    Returns:
        the vertex of each corner; its texture coordinate, (0,) for a mesh without; the triangles
        over the corners.
    """
    vertices = mesh.triangles[triangles].ravel()
    if len(mesh.uv_triangles) == 0:
        vertex, corner = np.unique(vertices, return_inverse=True)
        return vertex, vertex[:0], corner.reshape(-1, 3)
    pairs = np.column_stack([vertices, mesh.uv_triangles[triangles].ravel()])
    unique, corner = np.unique(pairs, axis=0, return_inverse=True)
    return unique[:, 0], unique[:, 1], corner.reshape(-1, 3)


def _whole_triangles(mesh: Mesh, parts: tuple[str, ...]) -> Int[Array, " f"]:
    chosen = mesh.triangles_of(*parts)
    a, b, c = mesh.triangles[chosen].T
    whole: Array = chosen[(a != b) & (b != c) & (c != a)]
    if len(whole) == 0:
        raise InputError("part", "at least one that has triangles", ", ".join(parts) or "none")
    return whole


def _compacted(mesh: Mesh) -> tuple[Mesh, Int[Array, " v"]]:
    """The mesh without unused vertices and texture coordinates, and which vertices are left."""
    kept, triangles = np.unique(mesh.triangles, return_inverse=True)
    kept_uvs, uv_triangles = np.unique(mesh.uv_triangles, return_inverse=True)
    compact = Mesh(
        vertices=mesh.vertices[kept],
        triangles=triangles.reshape(-1, 3),
        uvs=mesh.uvs[kept_uvs],
        uv_triangles=uv_triangles.reshape(-1, 3),
        part=mesh.part,
        part_names=mesh.part_names,
    )
    return compact, kept


def _unit_normals(mesh: Mesh) -> Float[Array, "v 3"]:
    normals = mesh.vertex_normals()
    # Where all triangles around a vertex have no area any direction will do.
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    return normals


def _texture_of(head: Head) -> dict[str, str]:
    """Neutral first; an expression without a texture of its own shows neutral's."""
    neutral = head.expressions[NEUTRAL].texture
    if neutral not in head.textures:
        return {}
    return {NEUTRAL: neutral} | {
        name: expression.texture if expression.texture in head.textures else neutral
        for name, expression in head.expressions.items()
    }


def _target(name: str, offsets: Float[Array, "v 3"]) -> MorphTarget:
    moved = np.flatnonzero(np.abs(offsets).max(axis=1) > _NEGLIGIBLE_MM)
    return MorphTarget(name, moved, offsets[moved])
