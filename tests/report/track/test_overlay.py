from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from filmed import broken, written
from mien.arrays import Array
from mien.capture.video.video import Video
from mien.errors import InputError
from mien.render.picture import GREY, HeadRenderer
from mien.report.track.caption import STATUS_COLOURS
from mien.report.track.overlay import (
    decode_tracked_frames,
    overlay_frames,
    repeat_counts,
    save_overlay,
)
from mien.track.state import Track
from posable import head
from tracks import random_state, track_of

SIZE = 96


@pytest.fixture(scope="module")
def renderer() -> HeadRenderer:
    return HeadRenderer(head())


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    """Of a small clip whose third frame is lost, at 10 frames a second."""
    states = [random_state(rng), random_state(rng), None, random_state(rng)]
    made = track_of(states, rng, times=[0.0, 0.1, 0.2, 0.3])
    return replace(made, width=SIZE, height=SIZE, focal_px=240.0, fps=10.0)


def frames(count: int, size: int = SIZE) -> list[Array]:
    """Plain, each of another brightness."""
    return [np.full((size, size, 3), 20 + 40 * index, np.uint8) for index in range(count)]


def far(a: Array, b: object) -> Array:
    return np.abs(a.astype(int) - np.asarray(b)).max(axis=-1)


def test_three_panels(renderer: HeadRenderer, track: Track) -> None:
    shown = list(overlay_frames(zip(frames(4), track.frames, strict=True), track, renderer))
    assert len({picture.shape for picture in shown}) == 1
    for index in (0, 1, 3):
        frame, over, alone = np.split(shown[index][:SIZE], 3, axis=1)
        assert far(frame, 20 + 40 * index).max() == 0
        changed, drawn = far(over, frame) > 0, far(alone, GREY) > 0
        assert 0.05 < changed.mean() < drawn.mean() < 0.8
        assert drawn[changed].all()


def test_a_lost_frame_is_alone(renderer: HeadRenderer, track: Track) -> None:
    *_, lost = list(overlay_frames(zip(frames(3), track.frames, strict=False), track, renderer))
    frame, over, alone = np.split(lost[:SIZE], 3, axis=1)
    assert far(frame, 100).max() == 0
    assert far(alone, GREY).max() == 0
    assert (far(over, STATUS_COLOURS["lost"]) == 0).any()
    assert (far(lost[SIZE:], STATUS_COLOURS["lost"]) < 60).any()


def test_a_frame_reduced_in_size_is_shown_in_full(renderer: HeadRenderer, track: Track) -> None:
    whole, half = (
        next(overlay_frames([(frames(1, size)[0], track.frames[0])], track, renderer))
        for size in (SIZE, SIZE // 2)
    )
    np.testing.assert_array_equal(whole, half)


@pytest.mark.parametrize(
    ("times", "fps", "counts"),
    [
        ([5.0, 5.04, 5.08, 5.12], 25, [1, 1, 1, 1]),
        ([0.0, 0.033, 0.067, 0.1], 30, [1, 1, 1, 1]),
        ([0.0, 0.1, 0.2, 0.5, 0.6], 10, [1, 1, 3, 1, 1]),
        ([0.0, 0.1, 0.3, 0.4, 1.0], 10, [1, 2, 1, 6, 1]),
        ([9.0, 9.1, 0.0, 0.1, 0.2], 10, [1, 1, 1, 1, 1]),
        ([0.0, 0.1, 5000.0, 5000.1], 10, [1, 100, 1, 1]),
        ([3.0], 24, [1]),
        ([3.0, 3.0], 24, [1, 1]),
    ],
)
def test_frames_keep_their_times_at_a_constant_rate(
    times: list[float], fps: float, counts: list[int]
) -> None:
    rate, found = repeat_counts(np.array(times), 24.0)
    assert rate == pytest.approx(fps, rel=1e-3)
    assert found.tolist() == counts


def test_a_clock_rounded_to_milliseconds_does_not_repeat_frames() -> None:
    rate, counts = repeat_counts(np.round(np.arange(3000) / 29.97, 3), 1.0)
    assert rate == pytest.approx(29.97, rel=1e-4)
    assert (counts == 1).all()


def test_overlay_of_a_clip_of_variable_rate(tmp_path: Path, track: Track) -> None:
    """Of variable rate, and longer than the track."""
    clip = written(tmp_path / "in.mp4", frames(6), times=[0, 1, 4, 5, 6, 7])
    times = [frame.seconds for frame in Video(clip).frames()]
    found = [replace(f, time=t) for f, t in zip(track.frames, times, strict=False)]
    told: list[tuple[int, int]] = []
    count = save_overlay(
        tmp_path / "out.mp4",
        clip,
        replace(track, frames=tuple(found)),
        head(),
        progress=lambda *step: told.append(step),
    )
    assert count == 6
    assert told == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]
    levels = [
        float(frame.pixels()[10:80, 10:80].mean()) for frame in Video(tmp_path / "out.mp4").frames()
    ]
    np.testing.assert_allclose(levels, [20, 60, 60, 60, 100, 140], atol=4)


def test_a_stream_that_breaks(tmp_path: Path, track: Track, rng: np.random.Generator) -> None:
    """The frames that were tracked before it broke."""
    noise = [rng.integers(0, 256, (SIZE, SIZE, 3), np.uint8) for _ in range(40)]
    clip = broken(written(tmp_path / "in.mkv", noise))
    readable = sum(1 for _ in Video(clip).frames())
    assert 4 <= readable < 40
    assert save_overlay(tmp_path / "out.mp4", clip, track, head()) == 4


def test_only_the_tracks_own_frames(tmp_path: Path, track: Track) -> None:
    clip = written(tmp_path / "in.mp4", frames(6))
    chosen = replace(track, frames=track.frames[1::2])
    assert [found.frame for _, found in decode_tracked_frames(clip, chosen)] == [1, 3]
    assert list(decode_tracked_frames(clip, replace(track, frames=()))) == []


def test_another_video_than_the_tracks(tmp_path: Path, track: Track) -> None:
    clip = written(tmp_path / "in.mp4", frames(3, 64))
    with pytest.raises(
        InputError, match=r"in\.mp4: expected 96x96 px as the track's .*, got 64x64"
    ):
        save_overlay(tmp_path / "out.mp4", clip, track, head())
    assert not (tmp_path / "out.mp4").exists()
