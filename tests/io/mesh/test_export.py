from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.export import export_head
from mien.io.mesh.head_animation import HeadAnimation


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".usdz", ".GLB"])
def test_the_suffix_tells_the_kind(small_head: Head, tmp_path: Path, suffix: str) -> None:
    if suffix == ".usdz":
        pytest.importorskip("pxr", reason="usd-core is not installed")
    export_head(small_head, tmp_path / f"head{suffix}")
    start = (tmp_path / f"head{suffix}").read_bytes()[:4]
    assert start == {".obj": b"# mi", ".usdz": b"PK\x03\x04"}.get(suffix, b"glTF")


@pytest.mark.parametrize(("name", "got"), [("head.fbx", r"\.fbx"), ("head", "no suffix")])
def test_another_suffix_is_refused_with_the_kinds(
    small_head: Head, tmp_path: Path, name: str, got: str
) -> None:
    with pytest.raises(InputError, match=rf"{name}: .* ends in \.glb, \.obj or \.usdz, got {got}"):
        export_head(small_head, tmp_path / name)


def test_units_can_be_left_out(small_head: Head, tmp_path: Path) -> None:
    export_head(small_head, tmp_path / "head.glb", units=False)
    data = (tmp_path / "head.glb").read_bytes()
    assert b"jawOpen" not in data
    assert b"joy" in data


@pytest.mark.parametrize("suffix", [".glb", ".usdz"])
def test_what_moves(small_head: Head, nod: HeadAnimation, tmp_path: Path, suffix: str) -> None:
    if suffix == ".usdz":
        pytest.importorskip("pxr", reason="usd-core is not installed")
    for name, animation in (("still", None), ("moving", nod)):
        export_head(small_head, tmp_path / f"{name}{suffix}", animation=animation)
    still, moving = (tmp_path / f"{name}{suffix}" for name in ("still", "moving"))
    assert moving.stat().st_size > still.stat().st_size


def test_what_a_kind_cannot_hold(small_head: Head, nod: HeadAnimation, tmp_path: Path) -> None:
    export_head(small_head, tmp_path / "joy.obj", expression="joy")
    with pytest.raises(InputError, match=r"head\.obj: expected a \.glb or \.usdz .* moves"):
        export_head(small_head, tmp_path / "head.obj", animation=nod)
    with pytest.raises(InputError, match=r"joy\.glb: expected an \.obj for joy alone, got \.glb"):
        export_head(small_head, tmp_path / "joy.glb", expression="joy")


def test_an_error_leaves_the_old_file(small_head: Head, tmp_path: Path) -> None:
    (tmp_path / "head.glb").write_bytes(b"old")
    with pytest.raises(InputError, match="got nose"):
        export_head(small_head, tmp_path / "head.glb", parts=["nose"])
    assert (tmp_path / "head.glb").read_bytes() == b"old"


class TestGenericHead:
    """The head that ships, whole: what every user's export looks like."""

    def test_the_khronos_validator_finds_nothing(
        self, generic: Head, tmp_path: Path, gltf_remarks: Callable[[Path], list[str]]
    ) -> None:
        export_head(generic, tmp_path / "head.glb")
        assert gltf_remarks(tmp_path / "head.glb") == []

    @pytest.mark.parametrize(("suffix", "mm"), [(".glb", 1000.0), (".obj", 1.0)])
    def test_trimesh_opens_it(self, generic: Head, tmp_path: Path, suffix: str, mm: float) -> None:
        export_head(generic, tmp_path / f"head{suffix}")
        scene = trimesh.load_scene(tmp_path / f"head{suffix}", process=False)
        assert set(scene.geometry) == {"skin", "eyes", "teeth", "tongue"} or suffix == ".glb"
        shown = generic.mesh.submesh(
            np.flatnonzero(~np.isin(generic.mesh.part, _indices(generic, "hair", "lashes")))
        )
        corners = shown.vertices[shown.triangles].reshape(-1, 3)
        np.testing.assert_allclose(mm * scene.bounds, [corners.min(0), corners.max(0)], rtol=1e-5)
        assert sum(len(part.faces) for part in scene.geometry.values()) == len(shown.triangles)

    def test_usd_core_opens_it(self, generic: Head, tmp_path: Path) -> None:
        pxr_usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
        export_head(generic, tmp_path / "head.usdz")
        stage = pxr_usd.Stage.Open(str(tmp_path / "head.usdz"))
        names = stage.GetPrimAtPath("/head/mesh").GetAttribute("skel:blendShapes").Get()
        assert tuple(names) == generic.unit_names


def _indices(head: Head, *parts: str) -> list[int]:
    return [head.mesh.part_names.index(part) for part in parts]
