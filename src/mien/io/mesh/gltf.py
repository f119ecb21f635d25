"""A head as binary glTF 2.0: metres, +Y up, +Z out of the face, expressions as morph targets."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from mien.arrays import Array, Int
from mien.head import Head
from mien.io.files.atomic import atomic_file
from mien.io.mesh.glb import GlbBuffer, Json
from mien.io.mesh.gltf_animation import animation_json
from mien.io.mesh.gltf_materials import material_json, material_of
from mien.io.mesh.head_animation import HeadAnimation
from mien.io.mesh.surface import (
    ExportSurface,
    MaterialGroup,
    MorphTarget,
    export_surface,
    split_at_seams,
)

_METRES_PER_MM = 0.001


def save_glb(
    head: Head,
    path: str | Path,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    lit: bool = True,
    image: Literal["JPEG", "PNG"] = "JPEG",
    animation: HeadAnimation | None = None,
) -> None:
    """Write the head as one .glb, whole or not at all.

    One node and one mesh, a primitive and a material for each group of parts. Vertices are doubled
    at texture seams. The face units and the photographed expressions are morph targets, named in
    `mesh.extras.targetNames`; their offsets are stored sparse. Targets carry no normals, which
    would double the file: Blender computes them anew, real-time viewers shade with neutral's.
    Photographed expressions with a texture of their own are material variants.

    Args:
        parts: names of parts; by default all but the hair cap and the lashes.
        units: with the face units.
        lit: materials that the viewer's lights shade, which Blender opens as a Principled BSDF that
            can be worked on. False marks them unlit (KHR_materials_unlit): the texture as
            photographed, with the light that was there.
        image: how the textures are stored; PNG is exact and several times as large.
        animation: how the head moves.

    Raises:
        InputError: an unknown part, an animation of targets that the file has not, a place that
            cannot be written.
    """
    data = glb_bytes(head, parts=parts, units=units, lit=lit, image=image, animation=animation)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def glb_bytes(
    head: Head,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    lit: bool = True,
    image: Literal["JPEG", "PNG"] = "JPEG",
    animation: HeadAnimation | None = None,
) -> bytes:
    """As save_glb, in memory."""
    shapes = animation.shapes if animation is not None else None
    surface = export_surface(head, parts=parts, units=units, shapes=shapes)
    buffer = GlbBuffer()
    names = [target.name for target in surface.targets]
    mesh: Json = {
        "name": head.subject,
        "primitives": [
            _primitive(buffer, surface, group) | material_of(surface, index)
            for index, group in enumerate(surface.groups)
        ],
    }
    if names:
        mesh |= {"weights": [0.0] * len(names), "extras": {"targetNames": names}}
    document: Json = {
        "asset": {"version": "2.0", "generator": head.generator},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": head.subject, "mesh": 0}],
        "meshes": [mesh],
    }
    document |= material_json(buffer, surface, lit=lit, image=image)
    if animation is not None:
        document["animations"] = [animation_json(buffer, animation, names, node=0)]
    return buffer.to_glb(document)


def _primitive(buffer: GlbBuffer, surface: ExportSurface, group: MaterialGroup) -> Json:
    vertex, uv, triangles = split_at_seams(surface.mesh, group.triangles)
    positions = _METRES_PER_MM * surface.mesh.vertices[vertex]
    attributes = {
        "POSITION": buffer.add_vectors(positions, bounds=True),
        "NORMAL": buffer.add_vectors(surface.normals[vertex]),
    }
    if len(uv):
        # glTF counts v downwards from the top of the picture.
        u, v = surface.mesh.uvs[uv].T
        attributes["TEXCOORD_0"] = buffer.add_vectors(np.column_stack([u, 1 - v]))
    primitive: Json = {"attributes": attributes, "indices": buffer.add_triangles(triangles)}
    if surface.targets:
        primitive["targets"] = [
            {"POSITION": _add_target(buffer, vertex, target)} for target in surface.targets
        ]
    return primitive


def _add_target(buffer: GlbBuffer, vertex: Int[Array, " n"], target: MorphTarget) -> int:
    """The target's offsets at the primitive's corners, in metres."""
    rows = np.flatnonzero(np.isin(vertex, target.vertices))
    offsets = target.offsets[np.searchsorted(target.vertices, vertex[rows])]
    return buffer.add_offsets(len(vertex), rows, _METRES_PER_MM * offsets)
