"""The frames of a video tracked one after the other, each written into a journal at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.video.frames_ahead import frames_ahead
from mien.capture.video.video import Video, VideoInfo
from mien.errors import FileFormatError
from mien.head import Head
from mien.io.tracks.track_journal import Journal, journal_of, load_journal
from mien.limits import MAX_FPS
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.progress import Progress
from mien.reading.names import portable_name
from mien.track.state import Layout, Track, TrackedFrame

TRACKING = "Tracking"
_FPS_TOLERANCE = 1e-3
"""Relative difference up to which a video's stated rate counts as that of its frames."""


class VideoTracker(Protocol):
    """A tracker that can resume; `mien.track.tracker.Tracker` is one."""

    layout: Layout
    other_faces_seen: bool

    def step(self, pixels: UInt8[Array, "h w 3"], frame: int, time: float) -> TrackedFrame:
        """The next picture tracked: sRGB, its number, and its time in seconds."""

    def resume(self, frames: Sequence[TrackedFrame]) -> None:
        """Continue as if these frames had been tracked."""


@dataclass(frozen=True)
class TrackRun:
    """The inputs that determine the frames of a run.

    Attributes:
        clip: the video.
        info: of the video.
        prepared: the head.
        focal_px: of the clip's pictures.
        max_side: px; larger pictures are tracked reduced to it.
    """

    clip: Video
    info: VideoInfo
    prepared: PreparedHead
    focal_px: float
    max_side: int

    def tracker(self) -> VideoTracker:
        """A new tracker, before the first frame."""
        return self.prepared.tracker(self.info.width, self.info.height, self.focal_px)

    def journal(
        self, output: Path, layout: Layout, *, resume: bool
    ) -> tuple[Journal, tuple[TrackedFrame, ...]]:
        """The journal of a new run, or of a resumed one with the frames that it holds.

        Args:
            output: the table that the journal is of.
            layout: of the frames.
            resume: whether to go on with a journal if there is one.

        Raises:
            InputError: the journal of another run, a place that cannot be written.
            FileFormatError: the journal of another run.
        """
        path = journal_of(output)
        kept = load_journal(path, self.journal_header, layout) if resume and path.exists() else ()
        return Journal.start(path, self.journal_header, kept), kept

    @property
    def journal_header(self) -> dict[str, Any]:
        """The journal's first line: runs with different ones give different frames."""
        path = self.clip.path
        return {
            "generator": f"mien {version('mien')}",
            "video": {"name": portable_name(path), "bytes": path.stat().st_size},
            "head": head_digest(self.prepared.head),
            "focal_px": self.focal_px,
            "max_side": self.max_side,
            "options": asdict(self.prepared.options),
        }

    def track_frames(
        self,
        tracker: VideoTracker,
        journal: Journal,
        kept: Sequence[TrackedFrame],
        progress: Progress,
    ) -> tuple[TrackedFrame, ...]:
        """Track the frames after those that are kept; all of them.

        Args:
            tracker: before the first frame.
            journal: that each frame is added to.
            kept: frames that an earlier run has tracked.
            progress: called with TRACKING, the frames done and their total.

        Raises:
            FileFormatError: more frames are kept than the clip has.
        """
        from threadpoolctl import threadpool_limits

        frames, stated = list(kept), self.info.frames
        tracker.resume(frames)
        progress(TRACKING, len(frames), stated)
        # Decoding starts at the last frame that is kept, to check that the clip has it.
        clip_has_kept = not kept
        ahead = frames_ahead(self.clip, start=max(0, len(kept) - 1), max_side=self.max_side)
        # BLAS' own threads, busy waiting between its small products, would take the kernels' cores.
        with threadpool_limits(1, user_api="blas"), ahead as pictures:
            for picture in pictures:
                if picture.frame < len(kept):
                    clip_has_kept = True
                    continue
                # The clock of a joined clip may jump back; a track's does not.
                seconds = max(picture.seconds, frames[-1].time if frames else 0.0)
                frames.append(tracker.step(picture.pixels, picture.frame, seconds))
                journal.append(frames[-1])
                progress(TRACKING, len(frames), stated and max(stated, len(frames)))
        if not clip_has_kept:
            problem = f"expected at most the frames of {self.clip.path.name}, found {len(kept)}"
            raise FileFormatError(journal.path, problem, f"line {len(kept) + 1}")
        return tuple(frames)

    def track(self, layout: Layout, frames: tuple[TrackedFrame, ...]) -> Track:
        """The track of all frames."""
        info = self.info
        fps = mean_fps(frames, info.fps)
        return Track(layout, info.width, info.height, self.focal_px, fps, frames)


def mean_fps(frames: Sequence[TrackedFrame], stated: float) -> float:
    """Frames a second by their times, or as stated where the times agree or are missing.

    At most MAX_FPS, for a broken clock may give any rate.

    Args:
        frames: in the order of their times.
        stated: the rate that the video states.
    """
    elapsed = frames[-1].time - frames[0].time if frames else 0.0
    if elapsed <= 0:
        return min(stated, MAX_FPS)
    rate = (len(frames) - 1) / elapsed
    return min(stated if abs(rate / stated - 1) < _FPS_TOLERANCE else rate, MAX_FPS)


def head_digest(head: Head) -> str:
    """SHA-256 of everything that determines a head's shape and appearance."""
    arrays = {"triangles": head.mesh.triangles, "uvs": head.mesh.uvs, "units": head.units}
    arrays |= {f"vertices {name}": item.vertices for name, item in head.expressions.items()}
    arrays |= {f"texture {name}": pixels for name, pixels in head.textures.items()}
    arrays |= {f"region {name}": mask for name, mask in head.regions.items()}
    hashed = sha256(repr((head.unit_names, head.shading)).encode())
    for name, array in arrays.items():
        hashed.update(f"{name} {array.shape}".encode())
        hashed.update(np.ascontiguousarray(array).data)
    return hashed.hexdigest()
