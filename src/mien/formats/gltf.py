"""A head as binary glTF 2.0: metres, +Y up, +Z out of the face, face units as morph targets."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from mien.arrays import Array, Int
from mien.formats.atomic import atomic_file
from mien.formats.glb import GlbBuffer, Json
from mien.formats.image import encode_image
from mien.formats.surface import (
    ExportSurface,
    MaterialGroup,
    MorphTarget,
    export_surface,
    split_at_seams,
)
from mien.model.head import ATLAS, Head

_METRES_PER_MM = 0.001
_LINEAR, _LINEAR_MIPMAP_LINEAR, _CLAMP_TO_EDGE = 9729, 9987, 33071


def save_glb(
    head: Head,
    path: str | Path,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    lit: bool = True,
    image: Literal["JPEG", "PNG"] = "JPEG",
) -> None:
    """Write the head as one .glb, whole or not at all.

    One node and one mesh, a primitive and a material for each group of parts. Vertices are doubled
    at texture seams. The face units and the photographed expressions are morph targets, named in
    `mesh.extras.targetNames`; their offsets are stored sparse. Targets carry no normals, which
    would double the file: Blender computes them anew, real-time viewers shade with neutral's.

    Args:
        parts: names of parts; by default all but the hair cap and the lashes.
        units: with the face units.
        lit: materials that the viewer's lights shade, which Blender opens as a Principled BSDF
            that can be worked on. False marks them unlit (KHR_materials_unlit): the texture as
            photographed, with the light that was there.
        image: how the texture is stored; PNG is exact and several times as large.
    Raises: InputError: an unknown part, a place that cannot be written.
    """
    data = glb_bytes(head, parts=parts, units=units, lit=lit, image=image)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def glb_bytes(
    head: Head,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    lit: bool = True,
    image: Literal["JPEG", "PNG"] = "JPEG",
) -> bytes:
    """As save_glb, in memory."""
    surface = export_surface(head, parts=parts, units=units)
    buffer = GlbBuffer()
    mesh: Json = {
        "name": head.subject,
        "primitives": [
            _primitive(buffer, surface, group) | {"material": index}
            for index, group in enumerate(surface.groups)
        ],
    }
    if surface.targets:
        mesh["weights"] = [0.0] * len(surface.targets)
        mesh["extras"] = {"targetNames": [target.name for target in surface.targets]}
    document: Json = {
        "asset": {"version": "2.0", "generator": head.generator},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": head.subject, "mesh": 0}],
        "meshes": [mesh],
        "materials": [_material(group, surface, lit=lit) for group in surface.groups],
    }
    if not lit:
        document["extensionsUsed"] = ["KHR_materials_unlit"]
    if surface.texture is not None:
        document |= _texture(buffer, encode_image(surface.texture, image), image)
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


def _material(group: MaterialGroup, surface: ExportSurface, *, lit: bool) -> Json:
    reflection: Json = {"metallicFactor": 0.0, "roughnessFactor": group.roughness}
    if surface.texture is not None:
        reflection["baseColorTexture"] = {"index": 0}
    material: Json = {
        "name": group.name,
        "pbrMetallicRoughness": reflection,
        # The surfaces are open at the neck, lips and lids, and their inside can come into view.
        "doubleSided": True,
    }
    return material if lit else material | {"extensions": {"KHR_materials_unlit": {}}}


def _texture(buffer: GlbBuffer, data: bytes, kind: str) -> Json:
    """The one texture that all materials share."""
    image = {
        "name": ATLAS,
        "bufferView": buffer.add_bytes(data),
        "mimeType": f"image/{kind.lower()}",
    }
    sampler = {
        "magFilter": _LINEAR,
        "minFilter": _LINEAR_MIPMAP_LINEAR,
        "wrapS": _CLAMP_TO_EDGE,
        "wrapT": _CLAMP_TO_EDGE,
    }
    return {
        "images": [image],
        "samplers": [sampler],
        "textures": [{"sampler": 0, "source": 0}],
    }
