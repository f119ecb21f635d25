from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.camera import FRONTAL, head_angles_deg
from mien.numeric.rotation import rotation_from_vector
from mien.track.series import (
    quaternions,
    rotation_errors,
    series_of,
    translation_errors,
    truth_for,
)
from mien.track.state import Track
from tracks import LAYOUT, random_state, random_track, track_of

LOST = [3, 4]


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    return random_track(rng)


def test_every_number_is_there(track: Track) -> None:
    series = series_of(track)
    assert list(series.values) == list(series.deviations) == list(LAYOUT.channels)
    for row, found in enumerate(track.frames):
        if found.state is None:
            continue
        assert (series.numbers[row], series.times[row]) == (found.frame, found.time)
        assert series.status[row] == found.status
        assert (series.rms[row], series.seen[row]) == (found.rms, found.seen)
        np.testing.assert_array_equal(series.rotations[row], found.state.R_cam_head)
        np.testing.assert_array_equal(series.translations[row], found.state.t_cam_head)
        np.testing.assert_allclose(series.angles[row], head_angles_deg(track.camera(found.state)))
        for column, name in enumerate(LAYOUT.channels):
            assert series.values[name][row] == found.state.values[column]
            assert series.deviations[name][row] == found.deviations[column]


def test_lost_frames_are_nan(track: Track) -> None:
    series = series_of(track)
    assert np.flatnonzero(series.lost).tolist() == LOST
    for array in (series.rms, series.seen, series.rotations, series.angles, series.translations):
        assert np.isnan(array[LOST]).all()
        assert np.isfinite(np.delete(array, LOST, axis=0)).all()
    assert all(np.isnan(values[LOST]).all() for values in series.values.values())


def test_lost_frames_have_no_visible_share(track: Track) -> None:
    frames = tuple(replace(found, seen=0.0) for found in track.frames)
    assert np.isnan(series_of(replace(track, frames=frames)).seen[LOST]).all()


def test_reference_is_matched_by_frame_numbers(track: Track, rng: np.random.Generator) -> None:
    reference = replace(track, frames=track.frames[:0:-1])
    found = replace(track, frames=track.frames[::2])
    truth, series = truth_for(found, reference), series_of(found)
    assert truth.numbers.tolist() == [0, 2, 4, 6, 8]
    assert np.isnan(truth.translations[0]).all()
    np.testing.assert_array_equal(truth.translations[1:], series.translations[1:])


def test_errors_of_a_known_size(rng: np.random.Generator) -> None:
    true = random_state(rng)
    turn = rotation_from_vector(np.radians([0.0, 0.3, 0.0]))
    moved = replace(
        true, R_cam_head=turn @ true.R_cam_head, t_cam_head=true.t_cam_head * (1 + 0.004)
    )
    series, truth = (series_of(track_of([state, None], rng)) for state in (moved, true))
    np.testing.assert_allclose(rotation_errors(series, truth), [0.3, np.nan])
    np.testing.assert_allclose(translation_errors(series, truth), [0.4, np.nan])


def test_frontal_head_is_the_identity_quaternion(
    rng: np.random.Generator,
) -> None:
    facing = replace(random_state(rng), R_cam_head=FRONTAL)
    nodding = replace(facing, R_cam_head=rotation_from_vector(np.array([0.4, 0, 0])) @ FRONTAL)
    found = quaternions(series_of(track_of([facing, nodding, None], rng)))
    expected = [[0, 0, 0, 1], [np.sin(0.2), 0, 0, np.cos(0.2)], [np.nan] * 4]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_track_of_which_all_is_lost(rng: np.random.Generator) -> None:
    series = series_of(track_of([None, None], rng))
    assert series.lost.all()
    assert np.isnan(rotation_errors(series, series)).all()
    assert np.isnan(quaternions(series)).all()
