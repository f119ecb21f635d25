"""The preview materials of a head in USD, and a variant for each photographed expression."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np

from mien.arrays import Array
from mien.io.mesh.export_surface import ExportSurface, MaterialGroup

_SCOPE = "/head/materials"
_VARIANTS = "texture"


def texture_file_names(surface: ExportSurface) -> dict[str, str]:
    """The textures' names in the package."""
    files: dict[str, str] = {}
    for name in surface.textures:
        files[name] = f"{free_name(name, {file[:-4] for file in files.values()})}.jpg"
    return files


def define_materials(stage: Any, mesh: Any, surface: ExportSurface, files: dict[str, str]) -> None:
    """A material for each group, bound to its triangles, and the textures that they show."""
    for group in surface.groups:
        _bind_material(stage, mesh, group, textured=bool(files))
    _assign_textures(stage, surface, files)


def free_name(name: str, taken: Container[str]) -> str:
    """As near to the name as USD allows, and not one that is taken."""
    from pxr import Tf

    free: str = Tf.MakeValidIdentifier(name)
    while free in taken:
        free += "_"
    return free


def integers(indices: Array) -> Any:
    """A flat USD array of the indices."""
    from pxr import Vt

    return Vt.IntArray.FromNumpy(indices.astype(np.int32).ravel())


def _bind_material(stage: Any, mesh: Any, group: MaterialGroup, *, textured: bool) -> None:
    from pxr import Sdf, UsdGeom, UsdShade

    material = UsdShade.Material.Define(stage, f"{_SCOPE}/{group.name}")
    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(group.roughness)
    color = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if textured:
        color.ConnectToSource(_texture_output(stage, material))
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset(
        group.name, integers(group.triangles), UsdGeom.Tokens.face
    )
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)


def _texture_output(stage: Any, material: Any) -> Any:
    """The colour of the atlas at the mesh's texture coordinates."""
    from pxr import Sdf, UsdShade

    reader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("coordinates"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    place = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("texture"))
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(place)
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("clamp")
    return texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)


def _assign_textures(stage: Any, surface: ExportSurface, files: dict[str, str]) -> None:
    """Neutral's texture for good where it is the only one, else a variant for each expression."""
    if len(files) < 2:
        for file in files.values():
            _set_file(stage, surface, file)
        return
    # A value beside the variants would be stronger than theirs, so none is set there.
    variants = stage.GetDefaultPrim().GetVariantSets().AddVariantSet(_VARIANTS)
    names: list[str] = []
    for expression, texture in surface.texture_of.items():
        names.append(free_name(expression, names))
        variants.AddVariant(names[-1])
        variants.SetVariantSelection(names[-1])
        with variants.GetVariantEditContext():
            _set_file(stage, surface, files[texture])
    variants.SetVariantSelection(names[0])


def _set_file(stage: Any, surface: ExportSurface, file: str) -> None:
    from pxr import Sdf, UsdShade

    for group in surface.groups:
        prim = stage.GetPrimAtPath(f"{_SCOPE}/{group.name}/texture")
        UsdShade.Shader(prim).CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
