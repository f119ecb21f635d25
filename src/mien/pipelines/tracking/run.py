"""Frame after frame of a video through a tracker, each into a journal at once."""

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
from mien.pipelines.tracking.ready_head import ReadyHead
from mien.progress import Progress
from mien.reading.names import portable_name
from mien.track.state import Layout, Track, TrackedFrame

TRACKING = "Tracking"
_AGREE = 1e-3


class VideoTracker(Protocol):
    """What tracks; `mien.track.tracker.Tracker` does."""

    layout: Layout
    met_others: bool

    def step(self, pixels: UInt8[Array, "h w 3"], frame: int, time: float) -> TrackedFrame: ...

    def resume(self, frames: Sequence[TrackedFrame]) -> None: ...


@dataclass(frozen=True)
class TrackRun:
    """All that the frames of a run follow from.

    Attributes:
        focal_px: of the clip's pictures.
        max_side: px; larger pictures are tracked reduced to it.
    """

    clip: Video
    facts: VideoInfo
    ready: ReadyHead
    focal_px: float
    max_side: int

    def tracker(self) -> VideoTracker:
        """Before the first frame."""
        return self.ready.tracker(self.facts.width, self.facts.height, self.focal_px)

    def journal(
        self, output: Path, layout: Layout, *, resume: bool
    ) -> tuple[Journal, tuple[TrackedFrame, ...]]:
        """The journal of a new run, or of one that goes on with what was kept.

        Args:
            layout: of the frames.

        Raises:
            InputError: another run's, a place that cannot be written.
            FileFormatError: another run's, a place that cannot be written.
        """
        path = journal_of(output)
        kept = load_journal(path, self.header, layout) if resume and path.exists() else ()
        return Journal.start(path, self.header, kept), kept

    @property
    def header(self) -> dict[str, Any]:
        """As JSON has it: runs that differ in it give other frames."""
        path = self.clip.path
        return {
            "generator": f"mien {version('mien')}",
            "video": {"name": portable_name(path), "bytes": path.stat().st_size},
            "head": digest(self.ready.head),
            "focal_px": self.focal_px,
            "max_side": self.max_side,
            "options": asdict(self.ready.options),
        }

    def follow(
        self,
        tracker: VideoTracker,
        journal: Journal,
        kept: Sequence[TrackedFrame],
        tell: Progress,
    ) -> tuple[TrackedFrame, ...]:
        """Every frame, those that are kept and the ones after them.

        Args:
            tell: told TRACKING, the frames done and their total.

        Raises:
            FileFormatError: more frames are kept than the clip has.
        """
        from threadpoolctl import threadpool_limits

        frames, stated = list(kept), self.facts.frames
        tracker.resume(frames)
        tell(TRACKING, len(frames), stated)
        # The last one that is kept is looked for, too: the clip must have it.
        there = not kept
        ahead = frames_ahead(self.clip, start=max(0, len(kept) - 1), max_side=self.max_side)
        # BLAS' own threads, waiting for more of its small products, would take the kernels' cores.
        with threadpool_limits(1, user_api="blas"), ahead as pictures:
            for picture in pictures:
                if picture.frame < len(kept):
                    there = True
                    continue
                # The clock of a joined clip may jump back; a track's does not.
                seconds = max(picture.seconds, frames[-1].time if frames else 0.0)
                frames.append(tracker.step(picture.pixels, picture.frame, seconds))
                journal.append(frames[-1])
                tell(TRACKING, len(frames), stated and max(stated, len(frames)))
        if not there:
            problem = f"expected at most the frames of {self.clip.path.name}, found {len(kept)}"
            raise FileFormatError(journal.path, problem, f"line {len(kept) + 1}")
        return tuple(frames)

    def track(self, layout: Layout, frames: tuple[TrackedFrame, ...]) -> Track:
        """Of all frames."""
        facts = self.facts
        fps = mean_rate(frames, facts.fps)
        return Track(layout, facts.width, facts.height, self.focal_px, fps, frames)


def mean_rate(frames: Sequence[TrackedFrame], stated: float) -> float:
    """Frames a second by their times; as stated where they do not tell, or agree with it.

    At most MAX_FPS, whatever a broken clock says.
    """
    elapsed = frames[-1].time - frames[0].time if frames else 0.0
    if elapsed <= 0:
        return min(stated, MAX_FPS)
    rate = (len(frames) - 1) / elapsed
    return min(stated if abs(rate / stated - 1) < _AGREE else rate, MAX_FPS)


def digest(head: Head) -> str:
    """Of all that a head looks like."""
    arrays = {"triangles": head.mesh.triangles, "uvs": head.mesh.uvs, "units": head.units}
    arrays |= {f"vertices {name}": item.vertices for name, item in head.expressions.items()}
    arrays |= {f"texture {name}": pixels for name, pixels in head.textures.items()}
    arrays |= {f"region {name}": mask for name, mask in head.regions.items()}
    hashed = sha256(repr((head.unit_names, head.shading)).encode())
    for name, array in arrays.items():
        hashed.update(f"{name} {array.shape}".encode())
        hashed.update(np.ascontiguousarray(array).data)
    return hashed.hexdigest()
