"""Live tracking on a clock that moves only when something takes time."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from filmed import grey, written
from mien.animate.channels import head_rotation
from mien.animate.timeline import Moment
from mien.arrays import Array
from mien.camera import FRONTAL
from mien.capture.video.live_source import LiveFrame, LiveSource, PacedVideo
from mien.errors import InputError
from mien.pipelines.tracking.live_loop import (
    LiveStatus,
    moment_from_frame,
    open_live_source,
    run_live,
    track_live,
)
from mien.track.state import Layout, TrackedFrame, TrackState
from packets import as_unreal_reads, blend_values, listening, port_of
from posable import head
from tracks import LAYOUT, frame_of, random_state

STEP = 0.06


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@dataclass
class UnconvertedPicture:
    level: int

    def pixels(self, *, max_side: int | None = None) -> Array:
        side = max_side or 64
        return np.full((side, side, 3), self.level, np.uint8)


@dataclass
class Source:
    """A frame every 40 ms, every third of which is dropped."""

    clock: Clock
    count: int = 9
    width: int = 64
    height: int = 64
    fps: float = 25.0
    dropped: int = 0
    notes: list[str] = field(default_factory=list)
    closed: bool = False

    def frames(self) -> Generator[LiveFrame]:
        try:
            for index in range(self.count):
                if index % 3 == 2:
                    self.dropped += 1
                    continue
                taken = 100 + index / 25
                self.clock.now = max(self.clock.now, taken)
                yield LiveFrame(index, index / 25, taken, UnconvertedPicture(10 * index))
            self.notes.append("that was all")
        finally:
            self.closed = True

    def close(self) -> None: ...


@dataclass
class Tracker:
    """Takes STEP for a picture; finds the face in all but those of the given numbers."""

    clock: Clock
    rng: np.random.Generator
    lost: tuple[int, ...] = ()
    layout: Layout = LAYOUT
    seen: list[tuple[int, int, float]] = field(default_factory=list)
    interrupted: Callable[[int], bool] = lambda frame: False

    def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
        if self.interrupted(frame):
            raise KeyboardInterrupt
        self.seen.append((pixels.shape[0], int(pixels[0, 0, 0]), time))
        self.clock.now += STEP
        state = None if frame in self.lost else random_state(self.rng)
        return frame_of(frame, time, state, self.rng)


class Receiver:
    def __init__(self) -> None:
        self.sent: list[tuple[Moment | None, float]] = []

    def send(self, moment: Moment | None, seconds: float) -> None:
        self.sent.append((moment, seconds))


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def tracker(clock: Clock, rng: np.random.Generator) -> Tracker:
    return Tracker(clock, rng)


def test_every_picture_is_tracked_sent_and_reported(clock: Clock, tracker: Tracker) -> None:
    source, receivers = Source(clock), [Receiver(), Receiver()]
    tracker.lost = (3,)
    recorded: list[TrackedFrame] = []
    told: list[LiveStatus] = []
    summary = track_live(
        source, tracker, receivers, on_frame=recorded.append, on_status=told.append, clock=clock
    )
    indices = [0, 1, 3, 4, 6, 7]
    assert tracker.seen == [(64, 10 * index, index / 25) for index in indices]
    assert [frame.frame for frame in recorded] == indices
    assert [status.frame for status in told] == indices
    assert [status.status for status in told] == ["ok", "ok", "lost", "ok", "ok", "ok"]
    for receiver in receivers:
        assert [seconds for _, seconds in receiver.sent] == [index / 25 for index in indices]
        assert [moment is None for moment, _ in receiver.sent] == [i == 3 for i in indices]
    assert source.closed
    assert (summary.frames, summary.lost, summary.dropped) == (6, 1, 3)
    assert summary.notes == ("that was all",)


def test_rate_and_latency_are_those_of_the_clock(clock: Clock, tracker: Tracker) -> None:
    told: list[LiveStatus] = []
    summary = track_live(Source(clock), tracker, on_status=told.append, clock=clock)
    # Pictures 0, 1, 3, 4, 6, 7 of 40 ms; 60 ms of work each, waiting where there is nothing to do.
    done = np.array([0.06, 0.12, 0.18, 0.24, 0.30, 0.36])
    latencies = done - np.array([0, 1, 3, 4, 6, 7]) / 25
    assert [status.latency for status in told] == pytest.approx(latencies)
    assert [status.fps for status in told] == pytest.approx([0, *[1 / STEP] * 5])
    assert [status.dropped for status in told] == [0, 0, 1, 1, 2, 2]
    assert summary.latency == pytest.approx(np.median(latencies))
    assert (summary.seconds, summary.fps) == (pytest.approx(0.3), pytest.approx(1 / STEP))


def test_pictures_may_be_reduced(clock: Clock, tracker: Tracker) -> None:
    track_live(Source(clock), tracker, max_side=32, clock=clock)
    assert {side for side, _, _ in tracker.seen} == {32}


@pytest.mark.parametrize(("seconds", "frames"), [(0.12, 2), (0.0, 0), (9.0, 6)])
def test_it_stops_after_so_many_seconds(
    clock: Clock, tracker: Tracker, seconds: float, frames: int
) -> None:
    source = Source(clock)
    assert track_live(source, tracker, seconds=seconds, clock=clock).frames == frames
    assert source.closed or frames == 0


def test_ctrl_c_ends_it_and_keeps_what_was_tracked(clock: Clock, tracker: Tracker) -> None:
    source, recorded = Source(clock), list[TrackedFrame]()
    tracker.interrupted = lambda frame: frame == 4
    summary = track_live(source, tracker, on_frame=recorded.append, clock=clock)
    assert source.closed
    assert summary.frames == len(recorded) == 3


def test_nothing_to_track(clock: Clock, tracker: Tracker) -> None:
    summary = track_live(Source(clock, count=0), tracker, clock=clock)
    assert (summary.frames, summary.fps, summary.seconds, summary.latency) == (0, 0, 0, None)


def test_an_error_is_not_swallowed_and_the_source_is_closed(clock: Clock, tracker: Tracker) -> None:
    source = Source(clock)

    class DocumentError(Receiver):
        def send(self, moment: Moment | None, seconds: float) -> None:
            raise InputError("unit", "another", "this")

    with pytest.raises(InputError):
        track_live(source, tracker, [DocumentError()], clock=clock)
    assert source.closed


def test_moment_is_relative_to_a_frontal_head(rng: np.random.Generator) -> None:
    turned = head_rotation(0.3, -0.2, 0.1)
    state = TrackState(
        R_cam_head=FRONTAL @ turned,
        t_cam_head=np.array([10.0, -20.0, 700.0]),
        weights=np.array([[0.5, 0.5, 0.0], [1.0, 0.0, 0.0]]),
        units=np.array([0.7, 0.0]),
        gaze=np.array([0.1, 0.2]),
    )
    moment = moment_from_frame(frame_of(7, 1.25, state, rng), LAYOUT)
    assert moment is not None
    np.testing.assert_allclose(moment.rotation, turned)
    # To the subject's left, up, and away from the camera, which its z points to.
    np.testing.assert_allclose(moment.translation, [10, 20, -700])
    assert moment.time == 1.25
    assert moment.state == state.face(LAYOUT)
    assert moment.state.expressions["mouth"] == {"joy": 0.5, "anger": 0.0}
    assert moment_from_frame(frame_of(7, 1.25, None, rng), LAYOUT) is None


def test_a_video_stands_in_for_the_camera(
    tmp_path: Path, clock: Clock, tracker: Tracker, rng: np.random.Generator
) -> None:
    path = written(tmp_path / "a.mp4", grey([20, 60, 100, 140, 180, 220]))
    source = PacedVideo(path, clock=clock, sleep=clock.sleep)
    summary = track_live(source, tracker, clock=clock)
    assert (summary.frames, summary.dropped) == (6, 0)
    assert summary.latency == pytest.approx(STEP)
    assert summary.fps == pytest.approx(10)


def test_names_of_live_sources(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mp4", grey([20, 60]))
    assert isinstance(open_live_source(str(path)), PacedVideo)
    with pytest.raises(InputError, match="camera 99: expected a camera that is connected"):
        open_live_source("99")
    with pytest.raises(InputError, match="no such file"):
        open_live_source("-1")


def test_a_run_opens_source_and_streams_and_sends(tmp_path: Path, tracker: Tracker) -> None:
    path = written(tmp_path / "a.mp4", grey([20]))
    sizes: list[tuple[int, int]] = []

    def make_tracker(source: LiveSource) -> Tracker:
        sizes.append((source.width, source.height))
        return tracker

    with listening() as unreal, listening() as avatar:
        streams = [f"livelink://127.0.0.1:{port_of(unreal)}", f"vmc://:{port_of(avatar)}"]
        summary = run_live(str(path), head(), make_tracker, streams)
        _, subject, _, values = as_unreal_reads(unreal.recv(2048))
        sent = blend_values(avatar.recv(65536))
    assert (sizes, subject, summary.frames, summary.notes) == ([(64, 48)], "mien", 1, ())
    # Joy in the mouth smiles, in Unreal as in the avatar.
    smile = 0.9 * sent["mouth.joy"]
    assert values["mouthSmileLeft"] == pytest.approx(smile, abs=1e-6)
    assert sent["MouthSmileLeft"] == pytest.approx(smile, abs=1e-6)
    assert {name for name in sent if "." in name} == {
        f"{region}.{name}" for region in LAYOUT.regions for name in LAYOUT.expressions[1:]
    }


def test_a_run_fails_before_it_tracks(tmp_path: Path) -> None:
    def never(source: LiveSource) -> Tracker:
        raise AssertionError

    path = written(tmp_path / "a.mp4", grey([20]))
    with pytest.raises(InputError, match="--stream: expected livelink"):
        run_live(str(path), head(), never, ["udp://127.0.0.1"])
    with pytest.raises(InputError, match="no such file"):
        run_live(str(tmp_path / "b.mp4"), head(), never, ["vmc://"])
