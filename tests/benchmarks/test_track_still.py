from __future__ import annotations

import numpy as np
import pytest
from benchmarks.track_still import frame_motion, jitter, still_frames

from marbled import clutter
from mien.arrays import Array
from mien.numeric.rotation import rotation_from_vector

EYES = 60.0


def landmarks(middle: Array) -> Array:
    """(478, 2): all in the middle but the irises."""
    points = np.tile(middle, (478, 1))
    points[[468, 473], 0] += [-EYES / 2, EYES / 2]
    return points


def test_motion_is_that_of_the_picture() -> None:
    whole = np.repeat(clutter(240, 240, 1)[..., None], 3, axis=2).clip(0, 255).astype(np.uint8)
    frames = [whole[:200, :200], whole[:200, :200], whole[3:203, :200], whole[3:203, 4:204]]
    points = [landmarks(np.array([100.0, 100.0]))] * 4
    expected = [np.nan, 0, 3 / EYES, 4 / EYES]
    np.testing.assert_allclose(frame_motion(frames, points), expected, atol=1e-3)
    without = frame_motion(frames, [points[0], None, *points[2:]])
    assert np.isnan(without[:3]).all()


def test_stretches_are_long_enough_and_count_their_inner_frames() -> None:
    motion = np.array([np.nan, 0, 0, 0, 0, 9, 0, 0, 9, 0, 0, 0])
    expected = [0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0]
    assert still_frames(motion, below=1, least=3).astype(int).tolist() == expected
    assert still_frames(motion, below=1, least=4).sum() == 0


def test_jitter_is_the_second_difference(rng: np.random.Generator) -> None:
    count = 4000
    steady = np.arange(count)[:, None]
    turns = np.radians(rng.normal(0, 0.1, (count, 3)))
    rotations = rotation_from_vector(turns) @ rotation_from_vector([0.5, -0.3, 0.2])
    places = 500 * np.array([[0.0, 0.0, 1.0]]) + rng.normal(0, 1, (count, 3))
    nose = 0.01 * steady + rng.normal(0, 0.5, (count, 2))
    found = jitter(rotations, places, nose, np.ones(count, bool))
    # 1, -2, 1 makes a deviation of s one of s * sqrt(6); lengths add up over the axes.
    assert found.rotation == pytest.approx(0.1 * np.sqrt(18), rel=0.05)
    assert found.translation == pytest.approx(0.2 * np.sqrt(18), rel=0.05)
    assert found.nose == pytest.approx(0.5 * np.sqrt(12), rel=0.05)
    assert found.frames == count - 2


def test_a_steady_motion_does_not_tremble_and_lost_frames_are_left_out() -> None:
    count = 20
    steady = np.arange(count)[:, None]
    rotations = rotation_from_vector(steady * np.array([0.0, 0.02, 0.0]))
    places = np.array([0.0, 0.0, 600.0]) + steady * np.array([1.0, 0.0, 0.0])
    places[10] = np.nan
    found = jitter(rotations, places, places[:, :2], np.ones(count, bool))
    assert found.frames == count - 2 - 3
    assert max(found.rotation, found.translation, found.nose) < 1e-6
    assert jitter(rotations, places, places[:, :2], np.zeros(count, bool)).frames == 0
