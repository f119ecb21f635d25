"""Smoothing: steady motion stays, noise falls, losses are walls, a stated lag is the real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace

import numpy as np
import pytest

from mien.errors import InputError
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.track.smoothing import LiveFilter, smooth_track
from mien.track.state import Track, TrackedFrame, TrackState
from tracks import random_state, random_track, track_of

EVEN = np.arange(60) / 25
TURN = np.array([0.3, -1.1, 0.7])  # rad/s


@pytest.fixture
def varying(rng: np.random.Generator) -> np.ndarray:
    """Times of a varying rate."""
    return 3 + np.cumsum(rng.uniform(0.01, 0.08, 60))


def ramp(start: TrackState, speed: TrackState, time: float) -> TrackState:
    """A state that moves steadily; weights keep their sum."""
    drift = speed.weights - speed.weights.mean(axis=1, keepdims=True)
    return TrackState(
        R_cam_head=rotation_from_vector(TURN * time) @ start.R_cam_head,
        t_cam_head=start.t_cam_head + speed.t_cam_head * time,
        weights=start.weights + drift * time,
        units=start.units + speed.units * time,
        gaze=start.gaze + speed.gaze * time,
    )


def moving(rng: np.random.Generator, times: Sequence[float]) -> tuple[Track, Callable]:
    """A steady motion, and its state at any time."""
    start, speed = random_state(rng), random_state(rng)
    track = track_of([ramp(start, speed, time) for time in times], rng, times=times)
    return track, lambda time: ramp(start, speed, time)


def assert_same_state(found: TrackState, given: TrackState, tolerance: float = 1e-9) -> None:
    for name in TrackState.__dataclass_fields__:
        wanted = getattr(given, name)
        np.testing.assert_allclose(getattr(found, name), wanted, rtol=0, atol=tolerance)


def test_steady_motion_stays_at_any_rate(rng: np.random.Generator, varying: np.ndarray) -> None:
    for times in (EVEN, varying):
        track, _ = moving(rng, times)
        for found, given in zip(smooth_track(track, 0.1).frames, track.frames, strict=True):
            assert_same_state(found.state, given.state)
            others = [field.name for field in fields(TrackedFrame) if field.name != "state"]
            assert all(getattr(found, name) is getattr(given, name) for name in others)


def test_a_face_that_keeps_still_stays(rng: np.random.Generator) -> None:
    track = track_of([random_state(rng)] * 10, rng)
    for found, given in zip(smooth_track(track, 0.2).frames, track.frames, strict=True):
        assert_same_state(found.state, given.state)


def test_noise_falls_as_stated(rng: np.random.Generator) -> None:
    still = random_state(rng)
    shaken = [
        replace(
            still,
            R_cam_head=rotation_from_vector(rng.normal(0, 0.01, 3)) @ still.R_cam_head,
            t_cam_head=still.t_cam_head + rng.normal(0, 1, 3),
        )
        for _ in range(400)
    ]
    calm = [f.state for f in smooth_track(track_of(shaken, rng), 0.2).frames]
    off = np.array([state.t_cam_head - still.t_cam_head for state in calm])
    assert off.std() == pytest.approx(0.53 / np.sqrt(0.2 * 25), rel=0.2)
    turned = [angle_between(state.R_cam_head, still.R_cam_head) for state in calm]
    wanted = 0.01 * np.sqrt(3) * 0.53 / np.sqrt(0.2 * 25)
    assert np.sqrt(np.mean(np.square(turned))) == pytest.approx(wanted, rel=0.2)


def test_a_pulse_spreads_evenly_to_both_sides(rng: np.random.Generator) -> None:
    still = random_state(rng)
    rest, pulse = replace(still, units=np.zeros(2)), replace(still, units=np.ones(2))
    frames = smooth_track(
        track_of([pulse if n == 20 else rest for n in range(41)], rng), 0.08
    ).frames
    jaw = np.array([frame.state.units[0] for frame in frames])
    np.testing.assert_allclose(jaw, jaw[::-1], atol=1e-12)
    assert jaw.argmax() == 20
    assert jaw.sum() == pytest.approx(1)


def test_weights_keep_their_sum(rng: np.random.Generator) -> None:
    for frame in smooth_track(random_track(rng), 0.1).frames:
        if frame.state is not None:
            np.testing.assert_allclose(frame.state.weights.sum(axis=1), 1, atol=1e-12)


def test_nothing_is_smoothed_across_a_loss(rng: np.random.Generator) -> None:
    before, after = random_state(rng), random_state(rng)
    track = track_of([before] * 5 + [None] + [after] * 5, rng)
    found_anew = track_of([before] * 5 + [after] * 5, rng)
    frames = list(found_anew.frames)
    frames[5] = replace(frames[5], status="reacquired")
    for given in (track, replace(found_anew, frames=tuple(frames))):
        for found, wanted in zip(smooth_track(given, 0.2).frames, given.frames, strict=True):
            assert found.status == wanted.status
            assert (found.state is None) == (wanted.state is None)
            if wanted.state is not None:
                assert_same_state(found.state, wanted.state)


def test_short_tracks_stay(rng: np.random.Generator) -> None:
    for count in range(3):
        track = track_of([random_state(rng) for _ in range(count)], rng)
        for found, given in zip(smooth_track(track, 0.1).frames, track.frames, strict=True):
            assert_same_state(found.state, given.state)


@pytest.mark.parametrize("lag", [0.02, 0.1])
def test_the_live_filter_lags_as_it_states(
    rng: np.random.Generator, varying: np.ndarray, lag: float
) -> None:
    for times in (EVEN, varying):
        track, at = moving(rng, times)
        live = LiveFilter(lag)
        shown = [live.step(frame) for frame in track.frames][-1]
        assert_same_state(shown.state, at(times[-1] - live.lag), 1e-6)


def test_the_live_filter_calms_and_overshoots_nothing(rng: np.random.Generator) -> None:
    states = [replace(random_state(rng), units=np.full(2, float(n > 10))) for n in range(60)]
    live = LiveFilter(0.1)
    shown = [live.step(frame).state for frame in track_of(states, rng).frames]
    jaw = np.array([state.units[0] for state in shown])
    assert np.diff(jaw).min() >= -1e-12
    assert jaw.min() == pytest.approx(0, abs=1e-12)
    assert 0.99 < jaw.max() <= 1 + 1e-12
    for state in shown:
        np.testing.assert_allclose(state.weights.sum(axis=1), 1, atol=1e-12)


def test_the_live_filter_starts_anew_after_a_loss(rng: np.random.Generator) -> None:
    track = track_of([random_state(rng), random_state(rng), None, random_state(rng)], rng)
    live = LiveFilter(0.1)
    shown = [live.step(frame) for frame in track.frames]
    assert shown[2] is track.frames[2]
    for index in (0, 3):
        assert_same_state(shown[index].state, track.frames[index].state, 0)


def test_frames_of_one_time_do_not_break_it(rng: np.random.Generator) -> None:
    track = track_of([random_state(rng)] * 3, rng, times=[0.0, 0.0, 0.0])
    live = LiveFilter(0.1)
    for found in (*smooth_track(track, 0.1).frames, *map(live.step, track.frames)):
        assert_same_state(found.state, track.frames[0].state)


def test_bad_lengths_are_refused(rng: np.random.Generator) -> None:
    with pytest.raises(InputError, match="seconds: expected a number above zero"):
        smooth_track(random_track(rng), 0.0)
    with pytest.raises(InputError, match="lag: expected a number above zero"):
        LiveFilter(-1.0)
