"""A head as .usdz: a mesh, preview materials and the face units as blend shapes (extra `usd`)."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Container, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mien.arrays import Array, Float
from mien.errors import InputError
from mien.formats.atomic import atomic_file
from mien.formats.image import encode_image
from mien.formats.surface import ExportSurface, MaterialGroup, MorphTarget, export_surface
from mien.model.head import Head

# USD's own default unit, and what programs assume that do not read the file's.
_METRES_PER_UNIT = 0.01
_UNITS_PER_MM = 0.1
_ROOT = "/head"
_VARIANTS = "texture"
_PADDING_FIELD = 0x1986  # the extra field's kind that USD itself uses


def save_usdz(
    head: Head, path: str | Path, *, parts: Iterable[str] | None = None, units: bool = True
) -> None:
    """Write the head as one .usdz, whole or not at all: centimetres, y up.

    One mesh with a subset and a UsdPreviewSurface for each group of parts. Face units and
    photographed expressions are UsdSkel blend shapes, bound to a skeleton of one joint and to an
    animation that holds their weights, all zero. Expressions with a texture of their own make a
    variant set of the head, "texture": one is chosen, none are mixed.

    Args:
        parts: names of parts; by default all but the hair cap and the lashes.
        units: with the face units.
    Raises: InputError: usd-core is not installed; an unknown part, a place that cannot be written.
    """
    try:
        from pxr import Usd
    except ImportError:
        raise InputError(path, "usd-core (pip install 'mien[usd]')", "no such package") from None
    surface = export_surface(head, parts=parts, units=units)
    with TemporaryDirectory(prefix="mien-usd-") as folder:
        layer = Path(folder, "head.usdc")
        stage = Usd.Stage.CreateNew(str(layer))
        files = _texture_files(surface)
        _fill_stage(stage, surface, head, files)
        stage.Save()
        members = {layer.name: layer.read_bytes()}
    for name, file in files.items():
        members[file] = encode_image(surface.textures[name], "JPEG")
    data = _package(members)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def _package(members: dict[str, bytes]) -> bytes:
    """A .usdz: a zip archive whose members are stored as they are, from multiples of 64 bytes on.

    USD's own writer puts in the time of day; the same head shall give the same bytes.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, data in members.items():
            # 30 bytes of header, the name, and an extra field with 4 bytes of its own.
            padding = -(stream.tell() + 30 + len(name) + 4) % 64
            info = zipfile.ZipInfo(name)
            info.extra = struct.pack("<HH", _PADDING_FIELD, padding) + bytes(padding)
            archive.writestr(info, data)
    return stream.getvalue()


def _texture_files(surface: ExportSurface) -> dict[str, str]:
    """The textures' names in the package."""
    files: dict[str, str] = {}
    for name in surface.textures:
        files[name] = f"{_free_name(name, {file[:-4] for file in files.values()})}.jpg"
    return files


def _free_name(name: str, taken: Container[str]) -> str:
    """As near to the name as USD allows, and not one that is taken."""
    from pxr import Tf

    free: str = Tf.MakeValidIdentifier(name)
    while free in taken:
        free += "_"
    return free


def _fill_stage(stage: Any, surface: ExportSurface, head: Head, files: dict[str, str]) -> None:
    from pxr import UsdGeom, UsdSkel

    UsdGeom.SetStageMetersPerUnit(stage, _METRES_PER_UNIT)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    root = UsdSkel.Root.Define(stage, _ROOT)
    root.GetPrim().SetDisplayName(head.subject)
    stage.SetDefaultPrim(root.GetPrim())
    stage.GetRootLayer().comment = head.generator
    mesh = _define_mesh(stage, surface)
    extent = mesh.GetExtentAttr().Get()
    root.CreateExtentAttr(extent)
    for group in surface.groups:
        _bind_material(stage, mesh, group, textured=bool(files))
    _assign_textures(stage, surface, files)
    if surface.targets:
        _define_blend_shapes(stage, mesh, surface.targets)


def _define_mesh(stage: Any, surface: ExportSurface) -> Any:
    from pxr import Sdf, UsdGeom, Vt

    mesh = surface.mesh
    points = _points(mesh.vertices)
    prim = UsdGeom.Mesh.Define(stage, f"{_ROOT}/mesh")
    prim.CreatePointsAttr(points)
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.triangles), 3))
    prim.CreateFaceVertexIndicesAttr(_integers(mesh.triangles))
    # A triangle mesh is meant as it is; the default would round it off.
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateDoubleSidedAttr(True)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(surface.normals.astype(np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if len(mesh.uv_triangles):
        coordinates = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        coordinates.Set(Vt.Vec2fArray.FromNumpy(mesh.uvs.astype(np.float32)))
        coordinates.SetIndices(_integers(mesh.uv_triangles))
    return prim


def _bind_material(stage: Any, mesh: Any, group: MaterialGroup, *, textured: bool) -> None:
    from pxr import Sdf, UsdGeom, UsdShade

    material = UsdShade.Material.Define(stage, f"{_ROOT}/materials/{group.name}")
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
        group.name, _integers(group.triangles), UsdGeom.Tokens.face
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
        names.append(_free_name(expression, names))
        variants.AddVariant(names[-1])
        variants.SetVariantSelection(names[-1])
        with variants.GetVariantEditContext():
            _set_file(stage, surface, files[texture])
    variants.SetVariantSelection(names[0])


def _set_file(stage: Any, surface: ExportSurface, file: str) -> None:
    from pxr import Sdf, UsdShade

    for group in surface.groups:
        prim = stage.GetPrimAtPath(f"{_ROOT}/materials/{group.name}/texture")
        UsdShade.Shader(prim).CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)


def _define_blend_shapes(stage: Any, mesh: Any, targets: tuple[MorphTarget, ...]) -> None:
    from pxr import Gf, UsdSkel, Vt

    skeleton = UsdSkel.Skeleton.Define(stage, f"{_ROOT}/skeleton")
    skeleton.CreateJointsAttr(["head"])
    still = Vt.Matrix4dArray([Gf.Matrix4d(1.0)])
    skeleton.CreateBindTransformsAttr(still)
    skeleton.CreateRestTransformsAttr(still)
    names = Vt.TokenArray([target.name for target in targets])
    animation = UsdSkel.Animation.Define(stage, f"{_ROOT}/skeleton/animation")
    animation.CreateBlendShapesAttr(names)
    animation.CreateBlendShapeWeightsAttr(Vt.FloatArray(len(targets)))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(
        [animation.GetPath()]
    )
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    # One influence for all vertices would do by the specification; some readers want one for each.
    count = len(mesh.GetPointsAttr().Get())
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray(count))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray(count, 1.0))
    binding.CreateBlendShapesAttr(names)
    shapes = [_define_blend_shape(stage, mesh, target) for target in targets]
    binding.CreateBlendShapeTargetsRel().SetTargets(shapes)


def _define_blend_shape(stage: Any, mesh: Any, target: MorphTarget) -> Any:
    """Its path, which has the target's name as nearly as USD allows."""
    from pxr import UsdSkel

    taken = {child.GetName() for child in mesh.GetPrim().GetChildren()}
    shape = UsdSkel.BlendShape.Define(
        stage, mesh.GetPath().AppendChild(_free_name(target.name, taken))
    )
    shape.CreateOffsetsAttr(_points(target.offsets))
    shape.CreatePointIndicesAttr(_integers(target.vertices))
    return shape.GetPath()


def _points(millimetres: Float[Array, "n 3"]) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy((_UNITS_PER_MM * millimetres).astype(np.float32))


def _integers(indices: Array) -> Any:
    from pxr import Vt

    return Vt.IntArray.FromNumpy(indices.astype(np.int32).ravel())
