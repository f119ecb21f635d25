from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.obj import save_obj
from mien.mesh import Mesh


def test_trimesh_opens_it_with_its_texture(small_head: Head, tmp_path: Path) -> None:
    save_obj(small_head, tmp_path / "head.obj")
    scene = trimesh.load_scene(tmp_path / "head.obj", process=False)
    assert set(scene.geometry) == {"skin", "eyes"}
    mesh = small_head.mesh
    for name, part in (("skin", "skin"), ("eyes", "left_eyeball")):
        chosen = mesh.triangles_of(part)
        found = scene.geometry[name]
        expected = mesh.vertices[mesh.triangles[chosen]]
        np.testing.assert_allclose(found.vertices[found.faces], expected, rtol=1e-6, atol=1e-5)
        uvs = mesh.uvs[mesh.uv_triangles[chosen]]
        np.testing.assert_allclose(found.visual.uv[found.faces], uvs, atol=1e-6)
        pixels = np.asarray(found.visual.material.image.convert("RGB"))
        np.testing.assert_array_equal(pixels, small_head.textures["atlas"])


def test_an_expression_comes_with_its_texture_and_the_same_order(
    small_head: Head, tmp_path: Path
) -> None:
    save_obj(small_head, tmp_path / "joy.obj", expression="joy")
    scene = trimesh.load_scene(tmp_path / "joy.obj", process=False)
    mesh, joy = small_head.mesh, small_head.expressions["joy"]
    for name, part in (("skin", "skin"), ("eyes", "left_eyeball")):
        found = scene.geometry[name]
        expected = joy.vertices[mesh.triangles[mesh.triangles_of(part)]]
        np.testing.assert_allclose(found.vertices[found.faces], expected, rtol=1e-6, atol=1e-5)
        pixels = np.asarray(found.visual.material.image.convert("RGB"))
        np.testing.assert_array_equal(pixels, small_head.textures["joy"])
    save_obj(small_head, tmp_path / "neutral.obj")
    faces = [
        [line for line in (tmp_path / name).read_text("utf-8").splitlines() if line[:2] == "f "]
        for name in ("joy.obj", "neutral.obj")
    ]
    assert faces[0] == faces[1]


def test_an_expression_without_texture_shows_neutrals(small_head: Head, tmp_path: Path) -> None:
    textures = {"atlas": small_head.textures["atlas"]}
    save_obj(replace(small_head, textures=textures), tmp_path / "joy.obj", expression="joy")
    with Image.open(tmp_path / "joy.png") as image:
        np.testing.assert_array_equal(np.asarray(image), textures["atlas"])


def test_an_expression_that_the_head_has_not(small_head: Head, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expression: expected one of neutral, joy, got anger"):
        save_obj(small_head, tmp_path / "head.obj", expression="anger")


def test_normals_point_out(small_head: Head, tmp_path: Path) -> None:
    save_obj(small_head, tmp_path / "head.obj", parts=["skin"])
    skin = trimesh.load_mesh(tmp_path / "head.obj", process=False)
    assert (np.sum(skin.vertex_normals * skin.vertices, axis=1) > 0).all()
    assert skin.is_winding_consistent


def test_the_file_says_its_unit(small_head: Head, tmp_path: Path) -> None:
    save_obj(small_head, tmp_path / "head.obj")
    assert "# millimetres" in (tmp_path / "head.obj").read_text("utf-8")


def test_only_used_vertices_are_written(small_head: Head, tmp_path: Path) -> None:
    save_obj(small_head, tmp_path / "head.obj", parts=["left_eyeball"])
    lines = (tmp_path / "head.obj").read_text("utf-8").splitlines()
    used = small_head.mesh.vertices_of("left_eyeball")
    assert sum(line.startswith("v ") for line in lines) == len(used)


def test_a_name_with_spaces_has_side_files_without(small_head: Head, tmp_path: Path) -> None:
    save_obj(small_head, tmp_path / "my own head.obj")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"my own head.obj", "my_own_head.mtl", "my_own_head.png"}
    scene = trimesh.load_scene(tmp_path / "my own head.obj")
    assert scene.geometry["skin"].visual.material.image.size == (64, 32)


def test_without_texture_coordinates(small_head: Head, tmp_path: Path) -> None:
    mesh = small_head.mesh
    bare = Mesh(mesh.vertices, mesh.triangles, part=mesh.part, part_names=mesh.part_names)
    save_obj(replace(small_head, mesh=bare), tmp_path / "head.obj")
    assert {path.suffix for path in tmp_path.iterdir()} == {".obj", ".mtl"}
    scene = trimesh.load_scene(tmp_path / "head.obj")
    assert sum(len(part.faces) for part in scene.geometry.values()) == len(mesh.triangles)


def test_an_error_leaves_no_file(small_head: Head, tmp_path: Path) -> None:
    (tmp_path / "head.mtl").mkdir()
    with pytest.raises(InputError, match=r"head\.mtl: expected a file's name, got a folder"):
        save_obj(small_head, tmp_path / "head.obj")
    assert [path.name for path in tmp_path.iterdir()] == ["head.mtl"]


def test_the_same_head_gives_the_same_bytes(small_head: Head, tmp_path: Path) -> None:
    for folder in "ab":
        save_obj(small_head, tmp_path / folder / "head.obj")
    for name in ("head.obj", "head.mtl", "head.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
