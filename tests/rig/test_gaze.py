from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.rig.gaze import EYE_LOOK_UNITS, Eyeball, GazeModel, eye_look_angles

if TYPE_CHECKING:
    from conftest import Rigged

GENERIC = load_generic_head()
VERTICES = GENERIC.mesh.vertices


def test_the_units_turn_eyeballs_to_where_their_names_say() -> None:
    angles = eye_look_angles(GENERIC)
    assert set(angles) == set(EYE_LOOK_UNITS)
    for name, (yaw, pitch) in angles.items():
        left = name.endswith("Left")
        assert np.sign(pitch) == {"Up": 1, "Down": -1}.get(
            name[7 : -len("Left" if left else "Right")], 0
        )
        outwards = (1 if left else -1) * np.sign(yaw)
        assert outwards == (1 if "Out" in name else -1 if "In" in name else 0)
        assert 9 < np.degrees(np.hypot(yaw, pitch)) < 16


@pytest.mark.parametrize(("yaw", "pitch"), [(0.3, 0.0), (0.0, -0.2), (-0.25, 0.15)])
def test_a_round_eyeball_turns_rigidly_about_its_centre(yaw: float, pitch: float) -> None:
    eyeball = Eyeball.of(GENERIC, VERTICES, "left")
    points = VERTICES[eyeball.vertices]
    turned = eyeball.turned(points, yaw, pitch)
    np.testing.assert_allclose(turned.mean(axis=0), points.mean(axis=0), atol=1e-9)
    before, after = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (points, turned))
    np.testing.assert_allclose(after, before, atol=1e-9)
    linear = np.linalg.lstsq(points - eyeball.centre, turned - eyeball.centre, rcond=None)[0].T
    ahead = [np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)]
    np.testing.assert_allclose(linear @ [0, 0, 1], ahead, atol=1e-9)


def test_an_eyeball_that_is_not_round_stays_within_its_surface() -> None:
    linear = np.diag([1.25, 1.1, 1.15])
    eyeball = Eyeball.of(GENERIC, VERTICES @ linear.T, "right")
    points = VERTICES[eyeball.vertices] @ linear.T
    turned = eyeball.turned(points, 0.3, -0.2)
    before, after = (np.linalg.norm(eyeball.on_sphere(p), axis=1) for p in (points, turned))
    np.testing.assert_allclose(after, before, atol=1e-9)
    assert before.max() == pytest.approx(1)


def test_straight_ahead_changes_nothing(rigged: Rigged) -> None:
    posed = rigged.posed(jawOpen=0.2)
    np.testing.assert_allclose(rigged.moved(jawOpen=0.2), posed, rtol=0, atol=1e-12)
    eyeball = rigged.deformer.gaze_model.eyeballs[0]
    points = posed[eyeball.vertices]
    assert eyeball.turned(points, 0.0, 0.0) is points


def test_units_and_gaze_drive_the_same_turn(rigged: Rigged) -> None:
    gaze_model: GazeModel = rigged.deformer.gaze_model
    (yaw_in, _), (yaw_out, _) = (
        eye_look_angles(GENERIC)[name] for name in ("eyeLookInLeft", "eyeLookOutRight")
    )
    weights = {"eyeLookInLeft": 0.5, "eyeLookOutRight": 0.5 * yaw_in / yaw_out}
    by_units = rigged.moved(**weights)
    by_gaze = rigged.moved((0.5 * yaw_in, 0.0))
    for eyeball in gaze_model.eyeballs:
        np.testing.assert_allclose(by_units[eyeball.vertices], by_gaze[eyeball.vertices], atol=1e-5)


def test_at_weight_one_the_offsets_are_the_turn(rigged: Rigged) -> None:
    for name in EYE_LOOK_UNITS:
        weights = {name: 1.0}
        np.testing.assert_allclose(rigged.moved(**weights), rigged.posed(**weights), atol=1e-5)


def test_upper_lids_follow_the_pupil(rigged: Rigged) -> None:
    lid = GENERIC.polylines["left_upper_eyelid"][3]
    heights = [rigged.living((0.0, np.radians(angle)))[lid, 1] for angle in (-15, -5, 0, 5)]
    assert np.all(np.diff(heights) > 0.2)


def test_far_down_the_eye_is_still_open(rigged: Rigged) -> None:
    down = rigged.living((0.0, np.radians(-25)))
    for lids in rigged.deformer.contacts.lids:
        opening = -lids.overlap(lids.spherical(down)) * lids.eyeball.radius
        assert opening.max() > 1.0
