"""`mien track 0`: a head tracked while it is filmed, streamed, and written in the end."""

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
from mien.pipelines.tracking.live_loop import LiveStatus, LiveSummary, run_live
from mien.pipelines.tracking.notes import check_not_all_lost, track_notes
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.pipelines.tracking.run import VideoTracker, mean_fps
from mien.render.picture import GREY, HeadRenderer, render_head
from mien.track.lens import expected_focal, parse_lens
from mien.track.smoothing import LiveFilter
from mien.track.state import Layout, Track, TrackedFrame
from mien.track.tracker import TrackOptions

_WARM_UP_SIDE = 480  # px


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
    on_status: Callable[[LiveStatus], None] = lambda status: None,
) -> LiveSummary:
    """Track what is filmed now until it ends, or Ctrl-C; then write what was tracked.

    Args:
        source: a camera's number, or a video in its place.
        head: of the person who is filmed.
        files: what is written in the end; overlay and plots need a video.
        streams: addresses, as for streams.parse_stream.
        lens: as for track.lens.parse_lens; track.lens.expected_focal unless given, for no frames
            are known before.
        lag: seconds, as for track.smoothing.LiveFilter; nothing is smoothed unless given.
        seconds: of the source, after which tracking ends.
        options: of the tracker.
        on_status: called after every frame.

    Raises:
        InputError: before anything is tracked, an argument that cannot be used.
        FileFormatError: before anything is tracked, a source that is not a video.
        EstimationError: when all is written, a run whose frames are all lost.
    """
    if files is not None:
        files.check(Path(source))
    smoothing = None if lag is None else LiveFilter(lag)
    with LandmarkDetector() as detector:
        recorder = _LiveRecorder(
            PreparedHead(head, detector, options or TrackOptions()), lens, smoothing
        )
        summary = run_live(
            source,
            head,
            recorder.begin,
            streams,
            seconds=seconds,
            max_side=TRACKING_SIDE,
            on_status=on_status,
        )
    track, other_faces_seen = recorder.track(), recorder.other_faces_seen
    notes = [*summary.notes, *track_notes(track, head, other_faces_seen=other_faces_seen)]
    if files is not None:
        notes += files.write(track, Video(Path(source)), head, lambda *step: None)
    table = None if files is None else files.table
    check_not_all_lost(track, _source_name(source), table, other_faces_seen=other_faces_seen)
    return replace(summary, notes=tuple(notes))


def _source_name(source: str) -> str:
    return f"camera {source}" if source.isdecimal() else source


@dataclass
class _LiveRecorder:
    """The tracker of a live run, which keeps the frames.

    Attributes:
        prepared: the head.
        lens: as for track_live_video.
        smoothing: of the frames; None: they are not smoothed.
        layout: of the frames, once begin was called.
    """

    prepared: PreparedHead
    lens: str | None
    smoothing: LiveFilter | None
    layout: Layout = field(init=False)
    _tracker: VideoTracker = field(init=False)
    _empty: Track = field(init=False)
    _frames: list[TrackedFrame] = field(default_factory=list)

    def begin(self, live: LiveSource) -> Self:
        """Itself, with a tracker for the source that has been warmed up."""
        size = (live.width, live.height)
        head = self.prepared.head
        focal_px = expected_focal(head, *size).focal_px
        if self.lens is not None:
            focal_px = parse_lens(self.lens, *size)
        self._tracker = self.prepared.tracker(*size, focal_px)
        self.layout = self._tracker.layout
        self._empty = Track(self.layout, *size, focal_px, live.fps, ())
        warm_up(self._tracker, HeadRenderer(head, rig=self.prepared.model.rig), size)
        return self

    def step(self, pixels: UInt8[Array, "h w 3"], frame: int, time: float) -> TrackedFrame:
        """The next picture tracked, and smoothed if wanted."""
        tracked = self._tracker.step(pixels, frame, time)
        if self.smoothing is not None:
            tracked = self.smoothing.step(tracked)
        self._frames.append(tracked)
        return tracked

    @property
    def other_faces_seen(self) -> bool:
        """Whether in a lost frame there was a face."""
        return self._tracker.other_faces_seen

    def track(self) -> Track:
        """The track of all frames."""
        fps = mean_fps(self._frames, self._empty.fps)
        return replace(self._empty, fps=fps, frames=tuple(self._frames))


def warm_up(tracker: VideoTracker, renderer: HeadRenderer, size: tuple[int, int]) -> None:
    """Have a tracker find and track a rendered picture of the head, then reset it.

    Otherwise loading and compiling would delay the first pictures of a camera.

    Args:
        tracker: that is warmed up.
        renderer: of the head.
        size: width and height of the source's pictures, px.
    """
    factor = min(1.0, _WARM_UP_SIDE / max(size))
    width, height = (max(1, round(side * factor)) for side in size)
    pixels = render_head(renderer, size=(width, height), background=GREY)[..., :3].copy()
    for number in range(2):
        tracker.step(pixels, number, number / 25)
    tracker.resume([])
