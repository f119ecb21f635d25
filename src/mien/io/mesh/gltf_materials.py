"""The materials of a head in glTF 2.0, one set for each photographed expression's texture."""

from __future__ import annotations

from typing import Literal

from mien.io.files.image import encode_image
from mien.io.mesh.glb import GlbBuffer, Json
from mien.io.mesh.surface import ExportSurface, MaterialGroup

VARIANTS = "KHR_materials_variants"
UNLIT = "KHR_materials_unlit"

_LINEAR, _LINEAR_MIPMAP_LINEAR, _CLAMP_TO_EDGE = 9729, 9987, 33071


def material_json(
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


def material_of(surface: ExportSurface, group: int) -> Json:
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
