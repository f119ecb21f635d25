from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from glb_file import Glb
from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.gltf import glb_bytes, save_glb


@pytest.mark.parametrize("lit", [True, False])
@pytest.mark.parametrize("image", ["JPEG", "PNG"])
def test_the_khronos_validator_finds_nothing(
    small_head: Head,
    tmp_path: Path,
    gltf_remarks: Callable[[Path], list[str]],
    lit: bool,
    image: Any,
) -> None:
    save_glb(small_head, tmp_path / "head.glb", lit=lit, image=image)
    assert gltf_remarks(tmp_path / "head.glb") == []


def test_nor_about_a_head_without_texture_and_targets(
    small_head: Head, tmp_path: Path, gltf_remarks: Callable[[Path], list[str]]
) -> None:
    neutral = {"neutral": small_head.expressions["neutral"]}
    plain = replace(small_head, textures={}, expressions=neutral)
    save_glb(plain, tmp_path / "head.glb", units=False)
    # The one remark left: texture coordinates that no material uses, kept for the user's own.
    remarks = gltf_remarks(tmp_path / "head.glb")
    assert {remark.split()[0] for remark in remarks} == {"UNUSED_OBJECT"}


def test_triangles_are_the_meshs_in_metres(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head))
    mesh = small_head.mesh
    for material, part in (("skin", "skin"), ("eyes", "left_eyeball")):
        chosen = mesh.triangles_of(part)
        primitive = glb.primitive(material)
        expected = (mesh.vertices[mesh.triangles[chosen]] / 1000).astype(np.float32)
        np.testing.assert_allclose(glb.corners(primitive, "POSITION"), expected, rtol=1e-7)
        uvs = mesh.uvs[mesh.uv_triangles[chosen]]
        found = glb.corners(primitive, "TEXCOORD_0")
        np.testing.assert_allclose(found, np.stack([uvs[..., 0], 1 - uvs[..., 1]], -1), atol=1e-7)


def test_normals_are_smooth_across_the_texture_seam(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head))
    primitive = glb.primitive("skin")
    places, normals = (glb.corners(primitive, name) for name in ("POSITION", "NORMAL"))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-6)
    assert (np.sum(places * normals, axis=-1) > 0).all()
    _, place, count = np.unique(
        places.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    assert count.min() > 1
    for index in range(len(count)):
        shared = normals.reshape(-1, 3)[place.ravel() == index]
        np.testing.assert_array_equal(shared, np.broadcast_to(shared[0], shared.shape))


def test_units_and_expressions_are_morph_targets(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head))
    mesh = small_head.mesh
    names = glb.json["meshes"][0]["extras"]["targetNames"]
    assert names == ["eyeLookUpLeft", "jawOpen", "tongueOut", "joy"]
    joy = small_head.expressions["joy"].vertices - mesh.vertices
    offsets = dict(zip(names, [*small_head.units, joy], strict=True))
    for material, part in (("skin", "skin"), ("eyes", "left_eyeball")):
        corners = mesh.triangles[mesh.triangles_of(part)]
        for name in names:
            np.testing.assert_allclose(
                glb.target(glb.primitive(material), name),
                offsets[name][corners] / 1000,
                rtol=1e-6,
                atol=1e-12,
            )


def test_a_target_stores_only_what_it_moves(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head))
    kinds = {}
    for material in ("skin", "eyes"):
        primitive = glb.primitive(material)
        for name, target in zip(
            glb.json["meshes"][0]["extras"]["targetNames"], primitive["targets"], strict=True
        ):
            accessor = glb.json["accessors"][target["POSITION"]]
            kinds[material, name] = sorted({"bufferView", "sparse"} & set(accessor))
    assert kinds["skin", "jawOpen"] == ["sparse"]
    assert kinds["eyes", "jawOpen"] == kinds["skin", "tongueOut"] == []
    assert kinds["eyes", "eyeLookUpLeft"] == kinds["skin", "joy"] == ["bufferView"]


def test_an_expression_with_a_units_name_gets_another(small_head: Head) -> None:
    expressions = small_head.expressions | {"jawOpen": small_head.expressions["joy"]}
    glb = Glb(glb_bytes(replace(small_head, expressions=expressions)))
    assert glb.json["meshes"][0]["extras"]["targetNames"][3:] == ["joy", "jawOpen_photo"]


def test_the_texture_is_embedded_exactly_as_png(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head, image="PNG"))
    np.testing.assert_array_equal(glb.pixels(0), small_head.textures["atlas"])


def test_every_photographed_expression_shows_its_texture_as_a_variant(small_head: Head) -> None:
    sad = replace(small_head.expressions["joy"], texture="atlas")
    head = replace(small_head, expressions=small_head.expressions | {"sad": sad})
    glb = Glb(glb_bytes(head, image="PNG"))
    extension = "KHR_materials_variants"
    assert glb.json["extensionsUsed"] == [extension]
    variants = [item["name"] for item in glb.json["extensions"][extension]["variants"]]
    assert variants == ["neutral", "joy", "sad"]
    for part in ("skin", "eyes"):
        primitive = glb.primitive(part)
        shown = {
            variants[variant]: mapping["material"]
            for mapping in primitive["extensions"][extension]["mappings"]
            for variant in mapping["variants"]
        }
        assert glb.material_names[shown["joy"]] == f"{part}_joy"
        assert shown["neutral"] == shown["sad"] == primitive["material"]
        for name, texture in (("neutral", "atlas"), ("joy", "joy")):
            np.testing.assert_array_equal(glb.pixels(shown[name]), small_head.textures[texture])


def test_one_texture_makes_no_variants(small_head: Head) -> None:
    joy = replace(small_head.expressions["joy"], texture="atlas")
    glb = Glb(glb_bytes(replace(small_head, expressions=small_head.expressions | {"joy": joy})))
    assert len(glb.json["images"]) == 1
    assert not {"extensions", "extensionsUsed"} & set(glb.json)
    assert "extensions" not in glb.primitives[0]


def test_trimesh_opens_it(small_head: Head, tmp_path: Path) -> None:
    save_glb(small_head, tmp_path / "head.glb")
    scene = trimesh.load_scene(tmp_path / "head.glb", process=False)
    triangles = sum(len(part.faces) for part in scene.geometry.values())
    assert triangles == len(small_head.mesh.triangles)
    vertices = small_head.mesh.vertices / 1000
    np.testing.assert_allclose(scene.bounds, [vertices.min(0), vertices.max(0)], atol=1e-7)
    for part in scene.geometry.values():
        assert part.visual.material.baseColorTexture.size == (64, 32)


def test_parts_can_be_chosen(small_head: Head) -> None:
    glb = Glb(glb_bytes(small_head, parts=["left_eyeball"]))
    assert glb.material_names == ["eyes", "eyes_joy"]
    assert len(glb.primitives) == 1
    with pytest.raises(InputError, match=r"part: expected skin or .* or hair, got nose"):
        glb_bytes(small_head, parts=["nose"])
    with pytest.raises(InputError, match="part: expected at least one that has triangles"):
        glb_bytes(small_head, parts=["hair"])


def test_the_same_head_gives_the_same_bytes(small_head: Head) -> None:
    assert glb_bytes(small_head) == glb_bytes(small_head)
