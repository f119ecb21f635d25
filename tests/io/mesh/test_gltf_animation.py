from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glb_file import Glb
from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.gltf import glb_bytes, save_glb
from mien.io.mesh.head_animation import HeadAnimation


def channels(glb: Glb) -> dict[str, dict[str, Any]]:
    """The samplers by what they move."""
    (animation,) = glb.json["animations"]
    return {
        channel["target"]["path"]: animation["samplers"][channel["sampler"]]
        for channel in animation["channels"]
        if channel["target"]["node"] == 0
    }


def test_the_khronos_validator_finds_nothing(
    small_head: Head,
    nod: HeadAnimation,
    tmp_path: Path,
    gltf_remarks: Callable[[Path], list[str]],
) -> None:
    save_glb(small_head, tmp_path / "head.glb", animation=nod)
    assert gltf_remarks(tmp_path / "head.glb") == []


def test_times_have_their_bounds(small_head: Head, nod: HeadAnimation) -> None:
    glb = Glb(glb_bytes(small_head, animation=nod))
    inputs = {sampler["input"] for sampler in channels(glb).values()}
    assert len(inputs) == 1
    accessor = glb.json["accessors"][inputs.pop()]
    assert (accessor["type"], accessor["min"], accessor["max"]) == ("SCALAR", [0.0], [2.0])


def test_weights_stand_in_the_order_of_the_targets(small_head: Head, nod: HeadAnimation) -> None:
    glb = Glb(glb_bytes(small_head, animation=nod))
    names = glb.json["meshes"][0]["extras"]["targetNames"]
    found = glb.array(channels(glb)["weights"]["output"]).reshape(len(nod.times), len(names))
    expected = dict.fromkeys(names, np.zeros(len(nod.times))) | {
        name: nod.weights[:, index] for index, name in enumerate(nod.target_names)
    }
    np.testing.assert_allclose(found, np.column_stack([expected[name] for name in names]))


def test_the_heads_place_is_in_metres_and_unit_quaternions(
    small_head: Head, nod: HeadAnimation
) -> None:
    glb = Glb(glb_bytes(small_head, animation=nod))
    places = glb.array(channels(glb)["translation"]["output"])
    np.testing.assert_allclose(places, nod.translations_mm / 1000, rtol=1e-6)
    quaternions = glb.array(channels(glb)["rotation"]["output"])
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, atol=1e-6)
    matrices = Rotation.from_quat(quaternions).as_matrix()
    np.testing.assert_allclose(matrices, nod.rotations, atol=1e-6)
    assert (np.sum(quaternions[1:] * quaternions[:-1], axis=1) > 0).all(), "the long way round"


def test_only_what_moves_has_a_channel(small_head: Head) -> None:
    jaw = HeadAnimation([0, 1], ("jawOpen",), [[0], [1]])
    assert set(channels(Glb(glb_bytes(small_head, animation=jaw)))) == {"weights"}
    turn = HeadAnimation([0, 1], rotations=np.tile(np.eye(3), (2, 1, 1)))
    neutral = {"neutral": small_head.expressions["neutral"]}
    bare = Glb(glb_bytes(replace(small_head, expressions=neutral), units=False, animation=turn))
    assert set(channels(bare)) == {"rotation"}


def test_targets_that_the_file_has_not_are_named(small_head: Head, nod: HeadAnimation) -> None:
    message = "animation: expected names of the file's morph targets, got jawOpen"
    with pytest.raises(InputError, match=message):
        glb_bytes(small_head, units=False, animation=nod)
    neutral = {"neutral": small_head.expressions["neutral"]}
    with pytest.raises(InputError, match="animation: expected something that moves"):
        glb_bytes(
            replace(small_head, expressions=neutral), units=False, animation=HeadAnimation([0, 1])
        )
