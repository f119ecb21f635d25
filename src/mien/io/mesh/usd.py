"""A head as .usdz: a mesh, preview materials and the face units as blend shapes (extra `usd`)."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mien.arrays import Array, Float
from mien.errors import InputError
from mien.head import Head
from mien.io.files.atomic import atomic_file
from mien.io.files.image import encode_image
from mien.io.mesh.export_surface import ExportSurface, MorphTarget, export_surface
from mien.io.mesh.head_animation import HeadAnimation
from mien.io.mesh.usd_materials import define_materials, free_name, integers, texture_file_names

# USD's own default unit, and what programs assume that do not read the file's.
_METRES_PER_UNIT = 0.01
_UNITS_PER_MM = 0.1
_ROOT = "/head"
_ANIMATION = f"{_ROOT}/skeleton/animation"
_DEFAULT_RATE = 24.0  # time codes a second: USD's own
_PADDING_FIELD = 0x1986  # the extra field's kind that USD itself uses


def save_usdz(
    head: Head,
    path: str | Path,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    animation: HeadAnimation | None = None,
) -> None:
    """Write the head as one .usdz, whole or not at all: centimetres, y up.

    One mesh with a subset and a UsdPreviewSurface for each group of parts. Face units and
    photographed expressions are UsdSkel blend shapes, bound to a skeleton of one joint and to an
    animation that holds their weights, zero unless the head moves. Expressions with a texture of
    their own make a variant set of the head, "texture": one is chosen, none are mixed.

    Args:
        head: the head.
        path: the file.
        parts: names of parts; by default all but the hair cap and the lashes.
        units: with the face units.
        animation: how the head moves.

    Raises:
        InputError: usd-core is not installed; an unknown part, an animation of targets that the
            file has not, a place that cannot be written.
    """
    try:
        from pxr import Usd
    except ImportError:
        raise InputError(path, "usd-core (pip install 'mien[usd]')", "no such package") from None
    shapes = animation.shapes if animation is not None else None
    surface = export_surface(head, parts=parts, units=units, shapes=shapes)
    with TemporaryDirectory(prefix="mien-usd-") as folder:
        layer = Path(folder, "head.usdc")
        stage = Usd.Stage.CreateNew(str(layer))
        files = texture_file_names(surface)
        _fill_stage(stage, surface, head, files)
        if animation is not None:
            _animate(stage, animation, [target.name for target in surface.targets])
        stage.Save()
        members = {layer.name: layer.read_bytes()}
    for name, file in files.items():
        members[file] = encode_image(surface.textures[name], "JPEG")
    data = _package(members)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def _package(members: dict[str, bytes]) -> bytes:
    """A .usdz: a zip archive whose members are stored as they are, from multiples of 64 bytes on.

    USD's own writer puts in the time of day; here the same head gives the same bytes.
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
    define_materials(stage, mesh, surface, files)
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
    prim.CreateFaceVertexIndicesAttr(integers(mesh.triangles))
    # By default USD subdivides a mesh, which would round it off.
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateDoubleSidedAttr(True)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(surface.normals.astype(np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if len(mesh.uv_triangles):
        coordinates = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        coordinates.Set(Vt.Vec2fArray.FromNumpy(mesh.uvs.astype(np.float32)))
        coordinates.SetIndices(integers(mesh.uv_triangles))
    return prim


def _define_blend_shapes(stage: Any, mesh: Any, targets: tuple[MorphTarget, ...]) -> None:
    from pxr import Gf, UsdSkel, Vt

    skeleton = UsdSkel.Skeleton.Define(stage, f"{_ROOT}/skeleton")
    skeleton.CreateJointsAttr(["head"])
    still = Vt.Matrix4dArray([Gf.Matrix4d(1.0)])
    skeleton.CreateBindTransformsAttr(still)
    skeleton.CreateRestTransformsAttr(still)
    names = Vt.TokenArray([target.name for target in targets])
    animation = UsdSkel.Animation.Define(stage, _ANIMATION)
    animation.CreateBlendShapesAttr(names)
    animation.CreateBlendShapeWeightsAttr(Vt.FloatArray(len(targets)))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(
        [animation.GetPath()]
    )
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    # By the specification one influence for all vertices is enough; some readers need one for each.
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
        stage, mesh.GetPath().AppendChild(free_name(target.name, taken))
    )
    shape.CreateOffsetsAttr(_points(target.offsets))
    shape.CreatePointIndicesAttr(integers(target.vertices))
    return shape.GetPath()


def _animate(stage: Any, animation: HeadAnimation, names: list[str]) -> None:
    """Time samples of the blend shapes' weights and of the whole head's place.

    Frames fall on whole time codes where they are evenly spaced.
    """
    from pxr import Gf, UsdGeom, UsdSkel, Vt

    times = animation.times
    rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else _DEFAULT_RATE
    codes = (rate * times).tolist()
    stage.SetTimeCodesPerSecond(rate)
    stage.SetStartTimeCode(codes[0])
    stage.SetEndTimeCode(codes[-1])
    weights = animation.weights_of(names)
    if names:
        attribute = UsdSkel.Animation(stage.GetPrimAtPath(_ANIMATION)).GetBlendShapeWeightsAttr()
        for code, row in zip(codes, weights, strict=True):
            attribute.Set(Vt.FloatArray.FromNumpy(row.astype(np.float32)), code)
    place = UsdGeom.Xformable(stage.GetDefaultPrim())
    if animation.translations_mm is not None:
        translate = place.AddTranslateOp()
        for code, row in zip(codes, _UNITS_PER_MM * animation.translations_mm, strict=True):
            translate.Set(Gf.Vec3d(*row.tolist()), code)
    if animation.quaternions is not None:
        orient = place.AddOrientOp()
        for code, (x, y, z, w) in zip(codes, animation.quaternions.tolist(), strict=True):
            orient.Set(Gf.Quatf(w, x, y, z), code)


def _points(millimetres: Float[Array, "n 3"]) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy((_UNITS_PER_MM * millimetres).astype(np.float32))
