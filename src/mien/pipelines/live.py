"""`mien track 0`: a head followed as it is filmed, streamed, and kept until the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.live_source import LiveSource
from mien.capture.video.video import Video
from mien.head import Head
from mien.pipelines.track import TRACKING_SIDE
from mien.pipelines.tracking.live_tracker import LiveStatus, LiveSummary, run_live
from mien.pipelines.tracking.notes import check_found, track_notes
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.ready_head import ReadyHead
from mien.pipelines.tracking.run import VideoTracker, mean_rate
from mien.render.picture import GREY, HeadRenderer, render_head
from mien.track.lens import expected_focal, parse_lens
from mien.track.smoothing import LiveFilter
from mien.track.state import Layout, Track, TrackedFrame
from mien.track.tracker import TrackOptions

_WARM_SIDE = 480  # px


def track_live_video(
    source: str,
    head: Head,
    files: TrackFiles | None = None,
    streams: Sequence[str] = (),
    *,
    lens: str | None = None,
    lag: float | None = None,
    seconds: float | None = None,
    options: TrackOptions | None = None,
    tell: Callable[[LiveStatus], None] = lambda status: None,
) -> LiveSummary:
    """Track what is filmed now until it ends, or Ctrl-C; then write what was tracked.

    Args:
        source: a camera's number, or a video in its place.
        files: what is written in the end; overlay and plots need a video that is still there.
        streams: addresses, as for streams.parse_stream.
        lens: as for track.lens.parse_lens; what is usual unless given, for there is no looking
            ahead.
        lag: seconds, as for track.smoothing.LiveFilter; nothing is smoothed unless given.
        seconds: of the source, after which it ends by itself.
        tell: told after every frame how it goes.

    Raises:
        InputError: before anything is tracked, what cannot be used.
        FileFormatError: before anything is tracked, what cannot be used.
        EstimationError: when all is written, a run whose frames are all lost.
    """
    if files is not None:
        files.check(Path(source))
    calm = None if lag is None else LiveFilter(lag)
    with LandmarkDetector() as detector:
        take = _Take(ReadyHead(head, detector, options or TrackOptions()), lens, calm)
        summary = run_live(
            source, head, take.begun, streams, seconds=seconds, max_side=TRACKING_SIDE, tell=tell
        )
    track, others = take.track(), take.met_others
    notes = [*summary.notes, *track_notes(track, head, met_others=others)]
    if files is not None:
        notes += files.write(track, Video(Path(source)), head, lambda *step: None)
    table = None if files is None else files.table
    check_found(track, _named(source), table, met_others=others)
    return replace(summary, notes=tuple(notes))


def _named(source: str) -> str:
    return f"camera {source}" if source.isdecimal() else source


@dataclass
class _Take:
    """The tracker of a live run, which remembers what it found.

    Attributes:
        layout: of its numbers, once it has begun.
    """

    ready: ReadyHead
    lens: str | None
    calm: LiveFilter | None
    layout: Layout = field(init=False)
    _tracker: VideoTracker = field(init=False)
    _empty: Track = field(init=False)
    _frames: list[TrackedFrame] = field(default_factory=list)

    def begun(self, live: LiveSource) -> Self:
        """Itself, ready for the source's first picture."""
        size = (live.width, live.height)
        head = self.ready.head
        focal_px = expected_focal(head, *size).focal_px
        if self.lens is not None:
            focal_px = parse_lens(self.lens, *size)
        self._tracker = self.ready.tracker(*size, focal_px)
        self.layout = self._tracker.layout
        self._empty = Track(self.layout, *size, focal_px, live.fps, ())
        warm_up(self._tracker, HeadRenderer(head, rig=self.ready.model.rig), size)
        return self

    def step(self, pixels: UInt8[Array, "h w 3"], frame: int, time: float) -> TrackedFrame:
        """What the next picture shows, smoothed if that is wanted."""
        found = self._tracker.step(pixels, frame, time)
        if self.calm is not None:
            found = self.calm.step(found)
        self._frames.append(found)
        return found

    @property
    def met_others(self) -> bool:
        """Whether in a lost frame there was a face."""
        return self._tracker.met_others

    def track(self) -> Track:
        """All of them."""
        fps = mean_rate(self._frames, self._empty.fps)
        return replace(self._empty, fps=fps, frames=tuple(self._frames))


def warm_up(tracker: VideoTracker, renderer: HeadRenderer, size: tuple[int, int]) -> None:
    """Have a tracker find and follow the head's own picture, and forget it.

    What is loaded and compiled on the way would make it late for the first pictures of a camera.

    Args:
        size: width and height of the source's pictures, px.
    """
    factor = min(1.0, _WARM_SIDE / max(size))
    width, height = (max(1, round(side * factor)) for side in size)
    pixels = render_head(renderer, size=(width, height), background=GREY)[..., :3].copy()
    for number in range(2):
        tracker.step(pixels, number, number / 25)
    tracker.resume([])
