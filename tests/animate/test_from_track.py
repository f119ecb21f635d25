"""Tracks as performances: the camera of the video sees the head where the track says it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.animate.from_track import rest_camera, track_moments, track_timeline
from mien.animate.perform import frame_times, moved_camera
from mien.camera import FRONTAL
from mien.errors import InputError
from mien.numeric.rotation import rotation_from_vector
from mien.rig.state import FaceState
from mien.track.state import Layout
from tracks import LAYOUT, random_state, random_track, track_of

EVERYWHERE = Layout(("face", "mouth", "left_mouth", "right_eye"), ("neutral", "joy"))


def test_the_rest_camera_sees_every_moment_where_the_video_does(rng: np.random.Generator) -> None:
    track = random_track(rng)
    camera, points = rest_camera(track), rng.normal(scale=60, size=(20, 3))
    for frame, moment in zip(track.frames, track_moments(track), strict=True):
        if frame.state is not None:
            seen = moved_camera(camera, moment).project(points)
            np.testing.assert_allclose(seen, track.camera(frame.state).project(points), atol=1e-8)


def test_the_head_at_rest_faces_the_camera_where_it_mostly_was(rng: np.random.Generator) -> None:
    facing = replace(random_state(rng), R_cam_head=FRONTAL)
    away = replace(facing, t_cam_head=facing.t_cam_head + 300)
    track = track_of([facing, away, facing], rng)
    still, moved, _ = track_moments(track)
    np.testing.assert_allclose(still.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(still.translation, 0, atol=1e-9)
    # Camera space's right, down, forward are head space's left, down, back.
    np.testing.assert_allclose(moved.translation, (300, -300, -300), atol=1e-9)


def test_yaw_turns_to_the_subjects_left_and_pitch_down(rng: np.random.Generator) -> None:
    vectors = ((0, 0.3, 0), (0.2, 0, 0), (0, 0, -0.1))
    states = [
        replace(random_state(rng), R_cam_head=FRONTAL @ rotation_from_vector(np.array(vector)))
        for vector in vectors
    ]
    tracks = track_timeline(track_of(states, rng)).tracks
    np.testing.assert_allclose(tracks["head.yaw"].values, (0.3, 0, 0), atol=1e-9)
    np.testing.assert_allclose(tracks["head.pitch"].values, (0, 0.2, 0), atol=1e-9)
    np.testing.assert_allclose(tracks["head.roll"].values, (0, 0, -0.1), atol=1e-9)


@pytest.mark.parametrize("layout", [LAYOUT, EVERYWHERE], ids=["regions", "regions inside others"])
def test_faces_are_those_of_the_track(rng: np.random.Generator, layout: Layout) -> None:
    track = random_track(rng, layout=layout)
    for frame, moment in zip(track.frames, track_moments(track), strict=True):
        if frame.state is not None:
            assert_same_face(moment.state, frame.state.face(layout))


def assert_same_face(found: FaceState, given: FaceState) -> None:
    assert found.units == pytest.approx(given.units)
    assert (found.gaze.yaw, found.gaze.pitch) == pytest.approx((given.gaze.yaw, given.gaze.pitch))
    assert set(found.expressions) == set(given.expressions)
    for region, weights in given.expressions.items():
        assert found.expressions[region] == pytest.approx(weights)


def test_times_count_from_the_first_frame_and_fill_the_video(rng: np.random.Generator) -> None:
    track = random_track(rng)
    timeline = track_timeline(track)
    times = [moment.time for moment in track_moments(track)]
    np.testing.assert_allclose(times, np.arange(9) / 25, atol=1e-12)
    np.testing.assert_allclose(frame_times(timeline), times, atol=1e-12)
    assert timeline.fps == 25


def test_lost_frames_are_interpolated(rng: np.random.Generator) -> None:
    first, last = random_state(rng), random_state(rng)
    track = track_of([None, first, None, None, last, None], rng)
    jaw = [moment.state.units["jawOpen"] for moment in track_moments(track)]
    a, b = first.units[0], last.units[0]
    np.testing.assert_allclose(jaw, [a, a, (2 * a + b) / 3, (a + 2 * b) / 3, b, b])


def test_a_turn_past_the_back_goes_on(rng: np.random.Generator) -> None:
    angles = np.linspace(2.8, 3.5, 8)
    turns = [
        replace(random_state(rng), R_cam_head=FRONTAL @ rotation_from_vector(np.array([0, a, 0])))
        for a in angles
    ]
    yaw = track_timeline(track_of(turns, rng)).tracks["head.yaw"].values
    np.testing.assert_allclose(yaw, angles, atol=1e-9)


def test_frames_of_one_time_show_the_first(rng: np.random.Generator) -> None:
    states = [random_state(rng) for _ in range(3)]
    track = track_of(states, rng, times=[0.0, 0.0, 0.04])
    curve = track_timeline(track).tracks["units.jawOpen"]
    assert curve.times.tolist() == [0.0, 0.04]
    assert curve.values.tolist() == [states[0].units[0], states[2].units[0]]


def test_a_track_of_one_frame(rng: np.random.Generator) -> None:
    timeline = track_timeline(track_of([random_state(rng)], rng))
    assert timeline.duration == pytest.approx(1 / 25)
    assert len(frame_times(timeline)) == 1


def test_a_track_without_a_face_is_refused(rng: np.random.Generator) -> None:
    for states in ([], [None, None]):
        for use in (track_timeline, rest_camera, track_moments):
            with pytest.raises(InputError, match="at least one frame with a face"):
                use(track_of(states, rng))
