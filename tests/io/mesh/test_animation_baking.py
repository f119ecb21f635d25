from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glb_file import Glb
from mien.animate.timeline import Moment
from mien.errors import InputError
from mien.head import Head
from mien.io.mesh.animation_baking import bake_animation
from mien.io.mesh.export_surface import morph_offsets
from mien.io.mesh.gltf import glb_bytes, save_glb
from mien.numeric.rotation import rotation_from_vector
from mien.rig.state import FaceState, Gaze, PosedFace

TIMES = np.arange(12) / 24


class Puppet:
    """A rig of the small head that does what no sum of targets does: its eye turns."""

    def __init__(self, head: Head) -> None:
        self.head = head
        self.eye = head.mesh.vertices_of("left_eyeball")

    def evaluate(self, state: FaceState) -> PosedFace:
        vertices = self.head.mesh.vertices.copy()
        for unit, weight in state.units.items():
            vertices += weight * self.head.units[self.head.unit_names.index(unit)]
        joy = state.expressions.get("face", {}).get("joy", 0.0)
        vertices += joy * (self.head.expressions["joy"].vertices - self.head.mesh.vertices)
        mouth = state.expressions.get("mouth", {}).get("joy", 0.0)
        low = vertices[:, 1] < -50
        vertices[low] += mouth * np.array([0.0, 5.0, 1.0])
        centre = vertices[self.eye].mean(axis=0)
        turn = rotation_from_vector(np.array([-state.gaze.pitch, state.gaze.yaw, 0.0]))
        vertices[self.eye] = (vertices[self.eye] - centre) @ turn.T + centre
        ones = np.ones((len(vertices), 1))
        return PosedFace(vertices, ones, ones[:, 0])


def moment(time: float) -> Moment:
    state = FaceState(
        expressions={"face": {"neutral": 1 - time, "joy": time}, "mouth": {"joy": np.sin(time)}},
        units={"jawOpen": np.sin(6 * time), "tongueOut": 0.0},
        gaze=Gaze(0.5 * np.sin(9 * time), 0.3 * time),
    )
    turn = rotation_from_vector(np.array([0.0, time, 0.0]))
    return Moment(time, state, turn, np.array([0.0, time, 0.0]))


@pytest.fixture
def puppet(small_head: Head) -> Puppet:
    return Puppet(small_head)


def test_the_file_moves_as_the_rig_does(
    puppet: Puppet, tmp_path: Path, gltf_remarks: Callable[[Path], list[str]]
) -> None:
    moments = [moment(time) for time in TIMES]
    animation = bake_animation(puppet.head, moments, puppet.evaluate, tolerance_mm=0.01)
    save_glb(puppet.head, tmp_path / "head.glb", animation=animation)
    assert gltf_remarks(tmp_path / "head.glb") == []
    glb = Glb((tmp_path / "head.glb").read_bytes())
    names = glb.json["meshes"][0]["extras"]["targetNames"]
    weights = animation.weights_of(names)
    for part, material in (("skin", "skin"), ("left_eyeball", "eyes")):
        primitive = glb.primitive(material)
        rest = glb.corners(primitive, "POSITION")
        targets = np.stack([glb.target(primitive, name) for name in names])
        corners = puppet.head.mesh.triangles[puppet.head.mesh.triangles_of(part)]
        for index, played in enumerate(moments):
            found = 1000 * (rest + np.tensordot(weights[index], targets, axes=1))
            expected = puppet.evaluate(played.state).vertices[corners]
            assert np.linalg.norm(found - expected, axis=-1).max() < 0.012


def test_a_long_performance_comes_in_batches(
    puppet: Puppet, monkeypatch: pytest.MonkeyPatch
) -> None:
    moments = [moment(time) for time in np.arange(40) / 24]
    whole = bake_animation(puppet.head, moments, puppet.evaluate)
    monkeypatch.setattr("mien.io.mesh.animation_baking._BATCH", 7)
    parts = bake_animation(puppet.head, iter(moments), puppet.evaluate)
    assert len(whole.shapes) <= len(parts.shapes) <= len(whole.shapes) + 2
    for animation in (whole, parts):
        targets = morph_offsets(puppet.head) | animation.shapes
        shapes = np.stack([targets[name] for name in animation.target_names])
        for row, played in zip(animation.weights, moments, strict=True):
            found = puppet.head.mesh.vertices + np.tensordot(row, shapes, axes=1)
            missed = found - puppet.evaluate(played.state).vertices
            assert np.linalg.norm(missed, axis=1).max() <= 0.1 + 1e-9


def test_units_and_whole_expressions_keep_name_and_weight(puppet: Puppet) -> None:
    animation = bake_animation(puppet.head, [moment(time) for time in TIMES], puppet.evaluate)
    assert animation.target_names[:2] == ("jawOpen", "joy")
    columns = dict(zip(animation.target_names, animation.weights.T, strict=True))
    np.testing.assert_allclose(columns["jawOpen"], np.sin(6 * TIMES))
    np.testing.assert_allclose(columns["joy"], TIMES)
    further = [name for name in columns if name.startswith("motion_")]
    assert 2 <= len(further) <= 6
    assert set(animation.shapes) == set(further)
    assert all(np.abs(columns[name]).max() == pytest.approx(1) for name in further)


def test_motion_of_the_targets_alone_needs_no_corrective_shape(puppet: Puppet) -> None:
    still = [
        replace(
            moment(time),
            state=FaceState({"face": {"joy": time}}, {"jawOpen": 1 - time}),
            rotation=np.eye(3),
            translation=np.zeros(3),
        )
        for time in TIMES
    ]
    animation = bake_animation(puppet.head, still, puppet.evaluate)
    assert set(animation.target_names) == {"joy", "jawOpen"}
    assert animation.rotations is None
    assert animation.translations_mm is None


def test_the_heads_place_comes_along(puppet: Puppet) -> None:
    animation = bake_animation(puppet.head, [moment(time) for time in TIMES], puppet.evaluate)
    np.testing.assert_allclose(animation.rotations[5], moment(TIMES[5]).rotation)
    np.testing.assert_allclose(animation.translations_mm[:, 1], TIMES)


def test_an_expression_with_a_units_name_gets_another(puppet: Puppet) -> None:
    joy = puppet.head.expressions["joy"]
    head = replace(puppet.head, expressions=puppet.head.expressions | {"jawOpen": joy})
    state = FaceState({"face": {"jawOpen": 0.5}}, {"jawOpen": 0.25})
    half = head.mesh.vertices + 0.5 * (joy.vertices - head.mesh.vertices) + 0.25 * head.units[1]
    ones = np.ones((len(half), 1))
    posed = PosedFace(half, ones, ones[:, 0])
    played = Moment(0.0, state, np.eye(3), np.zeros(3))
    animation = bake_animation(head, [played], lambda _: posed)
    assert dict(zip(animation.target_names, animation.weights[0], strict=True)) == {
        "jawOpen": 0.25,
        "jawOpen_photo": 0.5,
    }


def test_bad_input_is_named(puppet: Puppet) -> None:
    with pytest.raises(InputError, match="moments: expected at least one, got none"):
        bake_animation(puppet.head, [], puppet.evaluate)
    with pytest.raises(InputError, match="tolerance_mm: expected a number above zero, got 0"):
        bake_animation(puppet.head, [moment(0)], puppet.evaluate, tolerance_mm=0)
    back = [moment(0.5), moment(0.25)]
    with pytest.raises(InputError, match="times: expected each later"):
        bake_animation(puppet.head, back, puppet.evaluate)


def test_further_shapes_must_fit(puppet: Puppet) -> None:
    animation = bake_animation(puppet.head, [moment(0.0), moment(0.5)], puppet.evaluate)
    shape = next(iter(animation.shapes.values()))
    with pytest.raises(InputError, match=r"shapes: expected names .* no other target has, got joy"):
        glb_bytes(puppet.head, animation=replace(animation, shapes={"joy": shape}))
    with pytest.raises(InputError, match="shape motion_1: expected shape"):
        glb_bytes(puppet.head, animation=replace(animation, shapes={"motion_1": shape[:-1]}))
