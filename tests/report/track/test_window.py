from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.report.track.window import Window, crop_window
from mien.track.state import Track
from posable import head
from tracks import random_state, track_of

HEAD = head()


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    return track_of([random_state(rng), None, random_state(rng)], rng)


def test_the_whole_frame_where_there_is_room(track: Track) -> None:
    window = crop_window(track, HEAD, (640, 400))
    assert window == Window(0, 0, 640, 360, 1.0)
    assert window.size == (640, 360)


@pytest.mark.parametrize("limits", [(600, 400), (200, 400), (600, 90)])
def test_otherwise_the_bounds_of_the_head(track: Track, limits: tuple[int, int]) -> None:
    window = crop_window(track, HEAD, limits)
    assert (np.array(window.size) <= limits).all()
    assert all(side % 2 == 0 for side in window.size)
    assert 0 < window.left < window.right < track.width
    for found in track.frames:
        if found.state is not None:
            x, y = track.camera(found.state).project(HEAD.mesh.vertices).T
            assert window.left <= x.min() <= x.max() <= window.right
            # A neck may leave the frame.
            inside = (y >= 0) & (y <= track.height)
            assert window.top <= y[inside].min() <= y[inside].max() <= window.bottom


def test_camera_of_the_window(track: Track) -> None:
    window = crop_window(track, HEAD, (200, 400))
    assert window.factor < 1
    state = track.frames[0].state
    assert state is not None
    points = HEAD.mesh.vertices[::50]
    whole, part = track.camera(state).project(points), window.camera(track, state).project(points)
    np.testing.assert_allclose(part, window.factor * (whole - [window.left, window.top]))


def test_crop_does_not_depend_on_the_frames_size(track: Track) -> None:
    rows, columns = np.mgrid[:360, :640]
    frame = np.stack([columns * 255 // 640, rows * 255 // 360, 0 * rows], axis=2).astype(np.uint8)
    window = Window(160, 40, 480, 200, 0.5)
    cut = window.crop(frame, track)
    assert cut.shape == (80, 160, 3)
    np.testing.assert_allclose(cut[0, 0, :2], [255 * 161 / 640, 255 * 41 / 360], atol=1)
    half = window.crop(np.ascontiguousarray(frame[::2, ::2]), track)
    assert np.abs(half.astype(int) - cut).max() <= 2


def test_a_track_that_never_found_the_head(rng: np.random.Generator) -> None:
    window = crop_window(track_of([None, None], rng), HEAD, (320, 400))
    assert window == Window(0, 0, 640, 360, 0.5)


def test_a_head_that_is_outside_of_the_frames(rng: np.random.Generator) -> None:
    state = replace(random_state(rng), t_cam_head=np.array([5000.0, 0, 700]))
    assert crop_window(track_of([state], rng), HEAD, (320, 400)) == Window(0, 0, 640, 360, 0.5)
