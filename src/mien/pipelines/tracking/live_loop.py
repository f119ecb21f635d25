"""Live tracking: each picture is tracked when it comes and sent to every receiver."""

from __future__ import annotations

import time
from array import array
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import median
from typing import Protocol

from mien.animate.timeline import Moment
from mien.arrays import Array, UInt8
from mien.camera import FRONTAL
from mien.capture.video.live_source import LiveSource, PacedVideo
from mien.head import Head
from mien.pipelines.tracking.streams import Stream, parse_stream
from mien.rig.unit_decomposition import units_from_state
from mien.track.state import Layout, Status, TrackedFrame

_RATE_FRAMES = 30  # The rate that is shown is counted over so many frames.


class LiveTracker(Protocol):
    """A tracker; `mien.track.tracker.Tracker` is one."""

    layout: Layout

    def step(self, pixels: UInt8[Array, "h w 3"], frame: int, time: float) -> TrackedFrame:
        """The next picture tracked: sRGB, its number, and its time in seconds."""


class Receiver(Protocol):
    """A receiver of frames; `mien.pipelines.tracking.streams.Stream` is one."""

    def send(self, moment: Moment | None, seconds: float) -> None:
        """Send a frame at its time; None: the face is lost."""


@dataclass(frozen=True)
class LiveStatus:
    """Progress of live tracking at one frame.

    Attributes:
        frame: its number.
        status: as TrackedFrame.status.
        fps: frames a second over the last ones; 0 at the first.
        latency: seconds from picture to packet.
        dropped: pictures that came too soon to be tracked, so far.
    """

    frame: int
    status: Status
    fps: float
    latency: float
    dropped: int


@dataclass(frozen=True)
class LiveSummary:
    """Summary of live tracking.

    Attributes:
        frames: how many were tracked.
        lost: how many of them are lost.
        dropped: pictures that came too soon to be tracked.
        seconds: from the first packet to the last.
        fps: frames a second; 0 of a single frame.
        latency: median seconds from picture to packet; None where there was no frame.
        notes: for the user.
    """

    frames: int
    lost: int
    dropped: int
    seconds: float
    fps: float
    latency: float | None
    notes: tuple[str, ...] = ()


def run_live(
    source: str,
    head: Head,
    make_tracker: Callable[[LiveSource], LiveTracker],
    streams: Sequence[str] = (),
    *,
    seconds: float | None = None,
    max_side: int | None = None,
    on_frame: Callable[[TrackedFrame], None] = lambda frame: None,
    on_status: Callable[[LiveStatus], None] = lambda status: None,
) -> LiveSummary:
    """Open a source and streams, track, and close them again.

    Args:
        source: a camera's number or a video, as for `open_live_source`.
        head: whose expressions the units of the streams stand for.
        make_tracker: called once, with the source open.
        streams: addresses, as for `parse_stream`.
        seconds: as for `track_live`.
        max_side: as for `track_live`.
        on_frame: as for `track_live`.
        on_status: as for `track_live`.

    Raises:
        InputError: before anything is tracked, a source or a stream that cannot be opened.
        FileFormatError: as InputError.
    """
    addresses = [parse_stream(text) for text in streams]
    with ExitStack() as stack:
        opened = [Stream(address, partial(units_from_state, head)) for address in addresses]
        for stream in opened:
            stack.enter_context(closing(stream))
        live = stack.enter_context(closing(open_live_source(source)))
        summary = track_live(
            live,
            make_tracker(live),
            opened,
            seconds=seconds,
            max_side=max_side,
            on_frame=on_frame,
            on_status=on_status,
        )
        notes = (note for stream in opened for note in stream.notes)
        return replace(summary, notes=(*summary.notes, *notes))


def open_live_source(text: str) -> LiveSource:
    """`0`, `1`, … for a camera of this computer; anything else is a video that stands in for one.

    Raises:
        InputError: no such camera, no such file.
        FileFormatError: not a video.
    """
    from mien.capture.video.webcam import Webcam

    return Webcam(int(text)) if text.isdecimal() and text.isascii() else PacedVideo(text)


def track_live(
    source: LiveSource,
    tracker: LiveTracker,
    receivers: Sequence[Receiver] = (),
    *,
    seconds: float | None = None,
    max_side: int | None = None,
    on_frame: Callable[[TrackedFrame], None] = lambda frame: None,
    on_status: Callable[[LiveStatus], None] = lambda status: None,
    clock: Callable[[], float] = time.monotonic,
) -> LiveSummary:
    """Track until the source ends, Ctrl-C, or so many seconds of the source.

    Args:
        source: of pictures.
        tracker: made for the source's width and height.
        receivers: that every frame is sent to.
        seconds: of the source, after which tracking ends.
        max_side: px; larger pictures are tracked reduced to it.
        on_frame: called with every tracked frame.
        on_status: called after every packet.
        clock: the source's.
    """
    from threadpoolctl import threadpool_limits

    meter = _RateMeter()
    one_thread = threadpool_limits(1, user_api="blas")
    with one_thread, closing(source.frames()) as pictures, suppress(KeyboardInterrupt):
        for picture in pictures:
            if seconds is not None and picture.seconds >= seconds:
                break
            pixels = picture.pixels(max_side=max_side)
            frame = tracker.step(pixels, picture.index, picture.seconds)
            moment = moment_from_frame(frame, tracker.layout)
            for receiver in receivers:
                receiver.send(moment, frame.time)
            on_frame(frame)
            on_status(meter.count(frame, clock(), picture.taken, source.dropped))
    return meter.summary(source)


def moment_from_frame(frame: TrackedFrame, layout: Layout) -> Moment | None:
    """A frame's face and head, the pose relative to one that faces the camera; None where lost."""
    state = frame.state
    if state is None:
        return None
    rotation, translation = FRONTAL.T @ state.R_cam_head, FRONTAL.T @ state.t_cam_head
    return Moment(frame.time, state.face(layout), rotation, translation)


@dataclass
class _RateMeter:
    """Rate and latency of the frames that are sent."""

    frames: int = 0
    lost: int = 0
    first: float = 0.0
    recent: deque[float] = field(default_factory=lambda: deque(maxlen=_RATE_FRAMES))
    latencies: array[float] = field(default_factory=lambda: array("d"))

    def count(self, frame: TrackedFrame, now: float, taken: float, dropped: int) -> LiveStatus:
        if not self.frames:
            self.first = now
        self.frames += 1
        self.lost += frame.state is None
        self.recent.append(now)
        self.latencies.append(now - taken)
        fps = _rate(len(self.recent), now - self.recent[0])
        return LiveStatus(frame.frame, frame.status, fps, now - taken, dropped)

    def summary(self, source: LiveSource) -> LiveSummary:
        seconds = self.recent[-1] - self.first if self.recent else 0.0
        return LiveSummary(
            frames=self.frames,
            lost=self.lost,
            dropped=source.dropped,
            seconds=seconds,
            fps=_rate(self.frames, seconds),
            latency=median(self.latencies) if self.frames else None,
            notes=tuple(source.notes),
        )


def _rate(count: int, seconds: float) -> float:
    return (count - 1) / seconds if seconds > 0 else 0.0
