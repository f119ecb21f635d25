"""A video in its own time, on a clock that moves only when something takes time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from filmed import broken, grey, written
from mien.capture.video.live_source import LiveFrame, PacedVideo
from mien.errors import FileFormatError, InputError


class Clock:
    """Seconds that pass while somebody sleeps or works."""

    def __init__(self, now: float = 500.0) -> None:
        self.now = now
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds

    work = sleep


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def video(tmp_path: Path, clock: Clock) -> PacedVideo:
    """Five frames at 0, 0.1, 0.5, 0.6 and 2 s."""
    path = written(tmp_path / "a.mp4", grey([20, 60, 100, 140, 180]), [0, 1, 5, 6, 20])
    return PacedVideo(path, clock=clock, sleep=clock.sleep)


def worked(frames: Iterator[LiveFrame], clock: Clock, seconds: float) -> list[int]:
    """The frames that somebody sees who takes so long for each."""
    seen = []
    for frame in frames:
        seen.append(frame.index)
        clock.now += seconds
    return seen


def test_properties_before_the_first_frame(video: PacedVideo) -> None:
    assert (video.width, video.height, video.fps) == (64, 48, pytest.approx(4.5, abs=0.1))


def test_a_fast_reader_waits_for_every_frame(video: PacedVideo, clock: Clock) -> None:
    for frame, seconds, level in zip(
        video.frames(), [0, 0.1, 0.5, 0.6, 2.0], [20, 60, 100, 140, 180], strict=True
    ):
        assert clock.now == pytest.approx(500 + seconds)
        assert frame.taken == pytest.approx(500 + seconds)
        assert frame.seconds == pytest.approx(seconds)
        assert frame.pixels().mean() == pytest.approx(level, abs=3)
        assert frame.pixels(max_side=32).shape == (24, 32, 3)
        clock.now += 0.03
    assert (video.dropped, video.notes) == (0, [])
    assert clock.slept == pytest.approx([0.07, 0.37, 0.07, 1.37])


@pytest.mark.parametrize(
    ("seconds", "seen"),
    [(0.09, [0, 1, 2, 3, 4]), (0.2, [0, 1, 2, 3, 4]), (0.55, [0, 2, 3, 4]), (0.7, [0, 3, 4])],
)
def test_a_slow_reader_gets_the_newest_frame(
    video: PacedVideo, clock: Clock, seconds: float, seen: list[int]
) -> None:
    assert worked(video.frames(), clock, seconds) == seen
    assert video.dropped == 5 - len(seen)


def test_the_last_frame_is_never_dropped(video: PacedVideo, clock: Clock) -> None:
    assert worked(video.frames(), clock, 100.0) == [0, 4]
    assert video.dropped == 3


def test_time_starts_with_the_first_frame_not_before(video: PacedVideo, clock: Clock) -> None:
    clock.now += 60
    assert worked(video.frames(), clock, 0) == [0, 1, 2, 3, 4]


def test_a_stream_that_breaks_ends_with_a_note(
    tmp_path: Path, clock: Clock, rng: np.random.Generator
) -> None:
    noise = rng.integers(0, 256, (40, 48, 64, 3), dtype="uint8")
    video = PacedVideo(broken(written(tmp_path / "a.mkv", noise)), clock=clock, sleep=clock.sleep)
    assert 10 < len(worked(video.frames(), clock, 0)) < 30
    assert len(video.notes) == 1


def test_one_frame(tmp_path: Path, clock: Clock) -> None:
    video = PacedVideo(written(tmp_path / "a.mp4", grey([90])), clock=clock, sleep=clock.sleep)
    assert worked(video.frames(), clock, 1) == [0]


def test_no_video(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        PacedVideo(tmp_path / "a.mp4")
    (tmp_path / "a.mp4").write_text("no video\n" * 100)
    with pytest.raises(FileFormatError, match="expected a video"):
        PacedVideo(tmp_path / "a.mp4")
