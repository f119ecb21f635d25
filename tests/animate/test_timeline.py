"""Timelines: layers add, clips come back, poses turn about the pivot."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.channels import head_angles_rad, head_rotation, split_channel
from mien.animate.curves import Curve, constant
from mien.animate.layers import Blink
from mien.animate.timeline import Clip, Layer, Placement, Timeline
from mien.errors import InputError

TIMES = np.linspace(0, 6, 61)
SMILE = Clip(2.0, {"units.mouthSmileLeft": Curve([0, 1, 2], [0, 1, 0])})


def test_layers_add_to_the_tracks() -> None:
    base, top = Curve([0, 6], [0, 1]), Curve([0, 3, 6], [0.5, -1, 2])
    weight = Curve([0, 6], [0, 1], ("linear", "linear"))
    timeline = Timeline(
        6.0,
        tracks={"units.jawOpen": base},
        layers=(
            Layer(weight=constant(0.5), tracks={"units.jawOpen": top, "mouth.joy": top}),
            Layer(weight=weight, tracks={"units.jawOpen": top}),
        ),
    )
    found = timeline.sample(TIMES)
    expected = base.at(TIMES) + (0.5 + TIMES / 6) * top.at(TIMES)
    np.testing.assert_allclose(found["units.jawOpen"], expected, atol=1e-12)
    np.testing.assert_allclose(found["mouth.joy"], 0.5 * top.at(TIMES), atol=1e-12)


def test_a_clip_plays_where_it_is_placed_and_nowhere_else() -> None:
    plays = (Placement("smile", 1.0, speed=2, weight=0.5, repeats=2), Placement("smile", 4.0))
    timeline = Timeline(6.0, placements=plays, clips={"smile": SMILE})
    curve = SMILE.tracks["units.mouthSmileLeft"]
    found = timeline.sample([0.9, 1.0, 1.25, 1.5, 2.25, 2.5, 3.0, 3.9, 4.5, 5.0, 6.0])
    middle, early = curve.at([0.5, 0.5])
    expected = [0, 0, 0.5 * middle, 0.5, 0.5 * early, 0.5, 0, 0, middle, 1, 0]
    np.testing.assert_allclose(found["units.mouthSmileLeft"], expected, atol=1e-12)


def test_clips_inside_of_clips_keep_time() -> None:
    outer = Clip(4.0, placements=(Placement("smile", 1.0),))
    timeline = Timeline(
        6.0, placements=(Placement("twice", 0.5, speed=2),), clips={"smile": SMILE, "twice": outer}
    )
    # 0.5 s + (1 s + 1 s) / 2: the middle of the smile.
    assert timeline.sample([1.5])["units.mouthSmileLeft"].tolist() == [1.0]


def test_a_moment_says_what_the_face_does() -> None:
    timeline = Timeline(
        2.0,
        tracks={
            "units.jawOpen": constant(1.7),
            "mouth.joy": constant(0.6),
            "face.anger": constant(-0.2),
            "gaze.yaw": constant(0.1),
        },
    )
    state = timeline.at(1.0).state
    assert state.units == {"jawOpen": 1.7}, "nothing is clamped here"
    assert state.expressions["face"] == {"anger": -0.2}
    assert (state.gaze.yaw, state.gaze.pitch) == (0.1, 0.0)


def test_regions_add_to_what_is_around_them() -> None:
    tracks = {"face.joy": 0.6, "mouth.joy": -0.2, "mouth.anger": 0.3, "left_mouth.anger": 0.1}
    state = Timeline(1.0, tracks={name: constant(v) for name, v in tracks.items()}).at(0).state
    assert state.expressions.keys() == {"face", "mouth", "left_mouth"}
    assert state.expressions["face"] == {"joy": 0.6}
    assert state.expressions["mouth"] == pytest.approx({"joy": 0.4, "anger": 0.3})
    assert state.expressions["left_mouth"] == pytest.approx({"joy": 0.4, "anger": 0.4})


def test_the_head_turns_about_the_pivot() -> None:
    pivot = np.array([1.0, -50.0, -70.0])
    tracks = {f"head.{name}": constant(v) for name, v in zip("xyz", (4, 5, 6), strict=True)}
    tracks |= {"head.yaw": constant(0.3), "head.pitch": constant(0.2), "head.roll": constant(-0.1)}
    moment = Timeline(1.0, pivot=pivot, tracks=tracks).at(0.5)
    moved = moment.rotation @ pivot + moment.translation
    np.testing.assert_allclose(moved, pivot + np.array([4, 5, 6]), atol=1e-12)


@pytest.mark.parametrize(
    ("angles", "point", "towards"),
    [
        ((0.1, 0, 0), [0, 0, 1], [1, 0, 0]),
        ((0, 0.1, 0), [0, 0, 1], [0, -1, 0]),
        ((0, 0, 0.1), [0, 1, 0], [-1, 0, 0]),
    ],
    ids=["yaw: nose to the left", "pitch: nose down", "roll: top to the right"],
)
def test_angles_turn_the_way_the_conventions_say(angles, point, towards) -> None:
    moved = head_rotation(*angles) @ point - np.array(point)
    assert moved @ np.array(towards) > 0.09


def test_angles_round_trip(rng: np.random.Generator) -> None:
    for angles in rng.uniform(-1.4, 1.4, (20, 3)):
        np.testing.assert_allclose(head_angles_rad(head_rotation(*angles)), angles, atol=1e-12)


def test_a_pose_equals_what_the_command_line_shows() -> None:
    from mien.render.orbit import orbit_camera

    vertices = np.array([[-80.0, -100, -90], [80, 100, 60]])
    front, turned = (
        orbit_camera(*angles, width=90, height=90, vertices=vertices)
        for angles in ((0, 0, 0), (-0.4, 0.3, 0.2))
    )
    expected = front.R_cam_head @ head_rotation(0.4, 0.3, 0.2)
    np.testing.assert_allclose(turned.R_cam_head, expected, atol=1e-12)


def test_generators_are_layers() -> None:
    timeline = Timeline(6.0, layers=(Layer("blink", generator=Blink(period=3)),))
    blinks = timeline.sample(np.arange(0, 6, 1 / 100))["units.eyeBlinkLeft"]
    assert blinks.max() == 1


LOOP = {
    "a": Clip(1.0, placements=(Placement("b", 0),)),
    "b": Clip(1.0, placements=(Placement("a", 0),)),
}
BOMB = {"c0": Clip(1.0)} | {
    f"c{i}": Clip(1.0, placements=(Placement(f"c{i - 1}", 0),) * 10) for i in range(1, 9)
}
DEEP = {"c0": Clip(1.0)} | {
    f"c{i}": Clip(1.0, placements=(Placement(f"c{i - 1}", 0),)) for i in range(1, 60)
}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration": -1}, "duration: expected a number above zero, got -1"),
        ({"duration": 1, "fps": 0}, "fps: expected a number above zero"),
        ({"duration": 1, "placements": (Placement("x", 0),)}, "clip: expected one of no clips"),
        ({"duration": 1, "clips": LOOP}, "does not contain itself, got a > b > a"),
        ({"duration": 1, "clips": BOMB}, "expected at most 10000 plays inside"),
        ({"duration": 1, "clips": dict(reversed(DEEP.items()))}, "nested at most 32 deep"),
        ({"duration": 1, "tracks": {"jawOpen": constant(1)}}, "channel: .* got jawOpen"),
        ({"duration": 1, "tracks": {"head.tilt": constant(1)}}, "channel: .* got head.tilt"),
    ],
)
def test_bad_timelines_are_named(arguments: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Timeline(**arguments)


def test_bad_placements_are_named() -> None:
    with pytest.raises(InputError, match="speed: expected a number above zero"):
        Placement("smile", 0, speed=0)
    with pytest.raises(InputError, match="at and weight: expected finite"):
        Placement("smile", float("nan"))
    assert split_channel("left_mouth.joy") == ("left_mouth", "joy")
