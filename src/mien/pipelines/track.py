"""`mien track`: head and face in every frame of a video, written into a table."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from mien.arrays import check_positive
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.orientation import turn_upright
from mien.capture.video.video import Video
from mien.head import Head
from mien.io.tracks.track_journal import journal_of
from mien.pipelines.tracking.notes import check_not_all_lost, track_notes
from mien.pipelines.tracking.outputs import DRAWING_OVERLAY, TrackFiles
from mien.pipelines.tracking.prepared_head import FINDING_FOCAL, PreparedHead, find_focal
from mien.pipelines.tracking.run import TRACKING, TrackRun
from mien.progress import Progress, no_progress
from mien.reading.names import check_path
from mien.track.lens import parse_lens
from mien.track.smoothing import smooth_track
from mien.track.state import STATUSES, Status, Track
from mien.track.tracker import TrackOptions

TRACKING_SIDE = 1920
"""px; larger pictures are reduced to it. Reducing smaller ones would take longer than it saves: a
face is compared at a size of its own."""
FRAME_STAGES = (FINDING_FOCAL, TRACKING, DRAWING_OVERLAY)
"""Stages whose steps are frames."""
STARTED_OVER = "the run that was not finished was started over; it could have been resumed"


@dataclass(frozen=True)
class Tracked:
    """Summary of the tracking of a video.

    Attributes:
        frames: how many.
        counts: of them, by status.
        resumed: how many of them an earlier run had tracked.
        fps: frames tracked a second, decoding included; None where there was none to track.
        rms: grey levels, the median of the frames'; None where all were lost.
        focal_px: of the video's pictures.
        notes: for the user.
    """

    frames: int
    counts: dict[Status, int]
    resumed: int
    fps: float | None
    rms: float | None
    focal_px: float
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        """`448 frames, 2 found again, 3 lost, 31.2 frames/s, error 6.1 grey levels`."""
        parts = [
            f"{self.frames} frames",
            f"{self.resumed} from before" * bool(self.resumed),
            f"{self.counts['reacquired']} found again" * bool(self.counts["reacquired"]),
            f"{self.counts['lost']} lost" * bool(self.counts["lost"]),
            "" if self.fps is None else f"{self.fps:.1f} frames/s",
            "" if self.rms is None else f"error {self.rms:.1f} grey levels",
        ]
        return ", ".join(filter(None, parts))


def track_video(
    video: str | Path,
    head: Head,
    files: TrackFiles,
    *,
    lens: str | None = None,
    smooth_seconds: float | None = None,
    resume: bool = False,
    options: TrackOptions | None = None,
    max_side: int = TRACKING_SIDE,
    progress: Progress | None = None,
) -> Tracked:
    """Track a head through a video and write its pose and expression in every frame.

    Every frame is added to a journal beside the table at once. A run that is stopped leaves it; one
    that resumes goes on from there and gives the same files, byte for byte, as one that was not
    stopped.
    `load_track` reads the table.

    Args:
        video: the file.
        head: of the person in it.
        files: where the results go, each written whole or not at all.
        lens: as for track.lens.parse_lens; estimated over the first frames unless given.
        smooth_seconds: as track.smoothing.smooth_track; nothing is smoothed unless given.
        resume: go on where an earlier run was stopped; from the start where there was none.
        options: of the tracker.
        max_side: px; larger pictures are tracked reduced to it.
        progress: called with the stage, frames done and their total.

    Returns:
        How many frames were tracked and how well, and notes for the user.

    Raises:
        InputError: before any work is done, a video or a place that cannot be used, a lens, a
            journal of another run.
        FileFormatError: as InputError.
        EstimationError: when all is written, a video whose frames are all lost.
    """
    report = progress or no_progress
    clip = Video(check_path("video", video, "a video"))
    files.check(clip.path)
    if smooth_seconds is not None:
        check_positive("smooth_seconds", smooth_seconds)
    info = clip.info()
    focal_px = None if lens is None else parse_lens(lens, info.width, info.height)
    notes = [STARTED_OVER] if journal_of(files.table).exists() and not resume else []
    with LandmarkDetector() as detector:
        if turn_upright(clip, detector):
            info = clip.info()
            focal_px = None if lens is None else parse_lens(lens, info.width, info.height)
        prepared = PreparedHead(head, detector, options or TrackOptions())
        if focal_px is None:
            focal_px, note = find_focal(clip, info, prepared, report)
            notes.append(note)
        run = TrackRun(clip, info, prepared, focal_px, max_side)
        tracker = run.tracker()
        journal, kept = run.journal(files.table, tracker.layout, resume=resume)
        with journal:
            start = time.perf_counter()
            frames = run.track_frames(tracker, journal, kept, report)
            seconds = time.perf_counter() - start
            track = run.track(tracker.layout, frames)
            smoothed = track if smooth_seconds is None else smooth_track(track, smooth_seconds)
            other_faces_seen = tracker.other_faces_seen
            notes += [*clip.notes, *track_notes(track, head, other_faces_seen=other_faces_seen)]
            notes += files.write(smoothed, clip, head, report)
            journal.remove()
    check_not_all_lost(track, clip.path, files.table, other_faces_seen=other_faces_seen)
    return _summary(track, len(kept), seconds, notes)


def _summary(track: Track, resumed: int, seconds: float, notes: Sequence[str]) -> Tracked:
    counts = Counter(frame.status for frame in track.frames)
    count = len(track.frames)
    errors = [frame.rms for frame in track.frames if frame.state is not None]
    return Tracked(
        frames=count,
        counts={status: counts[status] for status in STATUSES},
        resumed=resumed,
        fps=(count - resumed) / seconds if count > resumed else None,
        rms=median(errors) if errors else None,
        focal_px=track.focal_px,
        notes=tuple(notes),
    )
