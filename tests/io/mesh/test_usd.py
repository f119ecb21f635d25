from __future__ import annotations

import builtins
import os
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.head_animation import HeadAnimation
from mien.io.mesh.usd import save_usdz

pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Usd, UsdGeom, UsdShade, UsdSkel

MM = 10  # per unit of the file


@pytest.fixture
def stage(small_head: Head, tmp_path: Path) -> Usd.Stage:
    save_usdz(small_head, tmp_path / "head.usdz")
    return Usd.Stage.Open(str(tmp_path / "head.usdz"))


def complaints(stage: Usd.Stage) -> list[str]:
    """What the checks that come with USD say of a stage."""
    validation = pytest.importorskip("pxr.UsdValidation", reason="a usd-core without its checks")
    checks = validation.ValidationRegistry().GetOrLoadAllValidators()
    errors = validation.ValidationContext(checks).Validate(stage)
    return [f"{error.GetName()}: {error.GetMessage()}" for error in errors]


def test_usds_own_checks_pass(stage: Usd.Stage) -> None:
    assert complaints(stage) == []


def test_those_checks_do_find_faults(stage: Usd.Stage) -> None:
    stage.GetRootLayer().ClearDefaultPrim()
    assert any("default" in complaint.lower() for complaint in complaints(stage))


def test_the_mesh_is_the_heads_in_its_stated_unit(stage: Usd.Stage, small_head: Head) -> None:
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(0.01)
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert str(stage.GetDefaultPrim().GetPath()) == "/head"
    found = UsdGeom.Mesh(stage.GetPrimAtPath("/head/mesh"))
    mesh = small_head.mesh
    points = MM * np.array(found.GetPointsAttr().Get())
    np.testing.assert_allclose(points, mesh.vertices, rtol=1e-6, atol=1e-5)
    corners = np.array(found.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    np.testing.assert_array_equal(corners, mesh.triangles)
    st = UsdGeom.PrimvarsAPI(found).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    expected = mesh.uvs[mesh.uv_triangles].reshape(-1, 2)
    np.testing.assert_allclose(np.array(st.ComputeFlattened()), expected, atol=1e-7)


def test_blend_shapes_move_the_mesh(stage: Usd.Stage, small_head: Head) -> None:
    """At weight 1, through USD's own skinning query."""
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    prim = stage.GetPrimAtPath("/head/mesh")
    binding = UsdSkel.BindingAPI(prim)
    names = list(binding.GetBlendShapesAttr().Get())
    assert names == ["eyeLookUpLeft", "jawOpen", "tongueOut", "joy"]
    query = UsdSkel.BlendShapeQuery(binding)
    animation = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/head/skeleton")))
    assert list(animation.GetAnimQuery().GetBlendShapeOrder()) == names
    mesh = small_head.mesh
    joy = small_head.expressions["joy"].vertices - mesh.vertices
    for index, offsets in enumerate([*small_head.units, joy]):
        weights = np.zeros(len(names))
        weights[index] = 1
        points = UsdGeom.Mesh(prim).GetPointsAttr().Get()
        moved = query.ComputeDeformedPoints(
            *query.ComputeSubShapeWeights(weights.tolist()),
            query.ComputeBlendShapePointIndices(),
            query.ComputeSubShapePointOffsets(),
            points,
        )
        assert moved
        np.testing.assert_allclose(MM * np.array(points), mesh.vertices + offsets, atol=1e-4)


def test_each_group_has_its_textured_material(stage: Usd.Stage) -> None:
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/head/mesh"))
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    assert [subset.GetPrim().GetName() for subset in subsets] == ["skin", "eyes"]
    for subset in subsets:
        material, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
        texture = UsdShade.Shader(stage.GetPrimAtPath(f"{material.GetPath()}/texture"))
        assert os.path.basename(texture.GetInput("file").Get().path) == "atlas.jpg"


def test_each_expressions_texture_is_a_variant(stage: Usd.Stage) -> None:
    variants = stage.GetDefaultPrim().GetVariantSets().GetVariantSet("texture")
    assert variants.GetVariantNames() == ["joy", "neutral"]
    assert variants.GetVariantSelection() == "neutral"
    for name, file in (("joy", "joy.jpg"), ("neutral", "atlas.jpg")):
        variants.SetVariantSelection(name)
        for material in ("skin", "eyes"):
            prim = stage.GetPrimAtPath(f"/head/materials/{material}/texture")
            found = UsdShade.Shader(prim).GetInput("file").Get()
            assert (found.path, found.resolvedPath[-len(file) - 2 :]) == (file, f"[{file}]")
        assert complaints(stage) == []


def test_one_texture_makes_no_variants(small_head: Head, tmp_path: Path) -> None:
    joy = replace(small_head.expressions["joy"], texture="atlas")
    head = replace(small_head, expressions=small_head.expressions | {"joy": joy})
    save_usdz(head, tmp_path / "head.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "head.usdz"))
    assert not stage.GetDefaultPrim().GetVariantSets().GetNames()
    texture = UsdShade.Shader(stage.GetPrimAtPath("/head/materials/skin/texture"))
    assert os.path.basename(texture.GetInput("file").Get().path) == "atlas.jpg"


def test_the_package_holds_the_texture_uncompressed_and_aligned(
    small_head: Head, tmp_path: Path
) -> None:
    save_usdz(small_head, tmp_path / "head.usdz")
    data = (tmp_path / "head.usdz").read_bytes()
    with zipfile.ZipFile(tmp_path / "head.usdz") as package:
        members = package.infolist()
        contents = {member.filename: package.read(member) for member in members}
    assert list(contents) == ["head.usdc", "atlas.jpg", "joy.jpg"]
    for member in members:
        assert member.compress_type == zipfile.ZIP_STORED
        assert data.index(contents[member.filename]) % 64 == 0
        assert member.date_time[0] == 1980, "not the date of writing"


def test_it_moves(small_head: Head, nod: HeadAnimation, tmp_path: Path) -> None:
    save_usdz(small_head, tmp_path / "head.usdz", animation=nod)
    stage = Usd.Stage.Open(str(tmp_path / "head.usdz"))
    assert complaints(stage) == []
    second = stage.GetTimeCodesPerSecond()
    assert stage.GetStartTimeCode() == 0
    assert stage.GetEndTimeCode() / second == pytest.approx(2)
    weights = UsdSkel.Animation(stage.GetPrimAtPath("/head/skeleton/animation"))
    names = list(weights.GetBlendShapesAttr().Get())
    expected = nod.weights_of(names)
    assert nod.rotations is not None
    assert nod.translations_mm is not None
    for index, time in enumerate(nod.times):
        found = weights.GetBlendShapeWeightsAttr().Get(time * second)
        np.testing.assert_allclose(np.array(found), expected[index], atol=1e-6)
        root = UsdGeom.Xformable(stage.GetDefaultPrim())
        place = np.array(root.ComputeLocalToWorldTransform(time * second)).T
        np.testing.assert_allclose(place[:3, :3], nod.rotations[index], atol=1e-6)
        np.testing.assert_allclose(MM * place[:3, 3], nod.translations_mm[index], atol=1e-5)


def test_names_that_usd_cannot_use_stay_distinct(small_head: Head, tmp_path: Path) -> None:
    joy = small_head.expressions["joy"]
    head = replace(
        small_head, expressions=small_head.expressions | {"very sad": joy, "very-sad": joy}
    )
    save_usdz(head, tmp_path / "head.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "head.usdz"))
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/head/mesh"))
    assert list(binding.GetBlendShapesAttr().Get())[-2:] == ["very sad", "very-sad"]
    targets = binding.GetBlendShapeTargetsRel().GetTargets()
    assert [path.name for path in targets[-2:]] == ["very_sad", "very_sad_"]
    assert complaints(stage) == []


def test_without_texture_and_targets(small_head: Head, tmp_path: Path) -> None:
    neutral = {"neutral": small_head.expressions["neutral"]}
    head = replace(small_head, textures={}, expressions=neutral)
    save_usdz(head, tmp_path / "head.usdz", units=False)
    assert complaints(Usd.Stage.Open(str(tmp_path / "head.usdz"))) == []


def test_the_same_head_gives_the_same_bytes(small_head: Head, tmp_path: Path) -> None:
    for name in "ab":
        save_usdz(small_head, tmp_path / f"{name}.usdz")
    assert (tmp_path / "a.usdz").read_bytes() == (tmp_path / "b.usdz").read_bytes()


def test_without_usd_core_the_error_says_what_to_install(
    small_head: Head, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without_usd(name: str, *arguments: Any, **keywords: Any) -> Any:
        if name == "pxr":
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", without_usd)
    with pytest.raises(InputError, match=r"pip install 'mien\[usd\]'"):
        save_usdz(small_head, tmp_path / "head.usdz")
    assert list(tmp_path.iterdir()) == []
