"""A head as binary glTF 2.0: metres, +Y up, +Z out of the face, expressions as morph targets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from mien.arrays import Array, Int
from mien.errors import InputError
from mien.head import Head
from mien.io.files.atomic import atomic_file
from mien.io.files.image import encode_image
from mien.io.mesh.export_surface import (
    ExportSurface,
    MaterialGroup,
    MorphTarget,
    export_surface,
    split_at_seams,
)
from mien.io.mesh.glb import GlbBuffer, Json
from mien.io.mesh.head_animation import HeadAnimation

VARIANTS = "KHR_materials_variants"
UNLIT = "KHR_materials_unlit"

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
    animation: HeadAnimation | None = None,
) -> None:
    """Write the head as one .glb, whole or not at all.

    One node and one mesh, a primitive and a material for each group of parts. Vertices are doubled
    at texture seams. The face units and the photographed expressions are morph targets, named in
    `mesh.extras.targetNames`; their offsets are stored sparse. Targets carry no normals, which
    would double the file: Blender computes them anew, real-time viewers shade with neutral's.
    Photographed expressions with a texture of their own are material variants.

    Args:
        head: the head.
        path: the file.
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
            _primitive(buffer, surface, group) | _primitive_material(surface, index)
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
    document |= _material_json(buffer, surface, lit=lit, image=image)
    if animation is not None:
        document["animations"] = [_animation_json(buffer, animation, names, node=0)]
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


def _material_json(
    buffer: GlbBuffer, surface: ExportSurface, *, lit: bool, image: Literal["JPEG", "PNG"]
) -> Json:
    """The document's part on materials: neutral's for each group, then each other texture's.

    glTF mixes no textures. A viewer that knows KHR_materials_variants lets its user choose the
    expression whose texture shows; every other viewer shows neutral's.
    """
    extensions = [] if lit else [UNLIT]
    part: Json = {"materials": [_material(group, lit=lit) for group in surface.groups]}
    if surface.textures:
        part = {
            "materials": [
                _textured(material, index, name)
                for index, name in enumerate(surface.textures)
                for material in part["materials"]
            ]
        } | _textures(buffer, surface, image)
    if len(surface.textures) > 1:
        part["extensions"] = {VARIANTS: {"variants": [{"name": n} for n in surface.texture_of]}}
        extensions.append(VARIANTS)
    return part | ({"extensionsUsed": extensions} if extensions else {})


def _primitive_material(surface: ExportSurface, group: int) -> Json:
    """A primitive's part on materials: neutral's, and each expression's where there are several."""
    if len(surface.textures) < 2:
        return {"material": group}
    order = list(surface.textures)
    shown_by: dict[str, list[int]] = {name: [] for name in order}
    for variant, name in enumerate(surface.texture_of.values()):
        shown_by[name].append(variant)
    mappings = [
        {"material": order.index(name) * len(surface.groups) + group, "variants": variants}
        for name, variants in shown_by.items()
    ]
    return {"material": group, "extensions": {VARIANTS: {"mappings": mappings}}}


def _material(group: MaterialGroup, *, lit: bool) -> Json:
    material: Json = {
        "name": group.name,
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": group.roughness},
        # The surfaces are open at the neck, lips and lids, and their inside can come into view.
        "doubleSided": True,
    }
    return material if lit else material | {"extensions": {UNLIT: {}}}


def _textured(material: Json, index: int, texture: str) -> Json:
    reflection = material["pbrMetallicRoughness"] | {"baseColorTexture": {"index": index}}
    name = f"{material['name']}_{texture}" if index else material["name"]
    return material | {"name": name, "pbrMetallicRoughness": reflection}


def _textures(buffer: GlbBuffer, surface: ExportSurface, kind: Literal["JPEG", "PNG"]) -> Json:
    images = [
        {
            "name": name,
            "bufferView": buffer.add_bytes(encode_image(pixels, kind)),
            "mimeType": f"image/{kind.lower()}",
        }
        for name, pixels in surface.textures.items()
    ]
    sampler = {
        "magFilter": _LINEAR,
        "minFilter": _LINEAR_MIPMAP_LINEAR,
        "wrapS": _CLAMP_TO_EDGE,
        "wrapT": _CLAMP_TO_EDGE,
    }
    return {
        "images": images,
        "samplers": [sampler],
        "textures": [{"sampler": 0, "source": index} for index in range(len(images))],
    }


def _animation_json(
    buffer: GlbBuffer, animation: HeadAnimation, target_names: Sequence[str], *, node: int
) -> Json:
    """The animation of a node and its mesh, whose morph targets have these names.

    Raises:
        InputError: a target that moves is not among the names, nothing moves.
    """
    weights = animation.weights_of(target_names)
    samples: dict[str, Array] = {}
    if weights.size:
        samples["weights"] = weights.ravel()
    if animation.quaternions is not None:
        samples["rotation"] = animation.quaternions
    if animation.translations_mm is not None:
        samples["translation"] = _METRES_PER_MM * animation.translations_mm
    if not samples:
        raise InputError("animation", "something that moves", "neither targets nor the head")
    times = buffer.add_samples(animation.times, bounds=True)
    return {
        "name": animation.name,
        "channels": [
            {"sampler": index, "target": {"node": node, "path": path}}
            for index, path in enumerate(samples)
        ],
        "samplers": [
            {"input": times, "output": buffer.add_samples(values), "interpolation": "LINEAR"}
            for values in samples.values()
        ],
    }
