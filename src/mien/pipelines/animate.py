"""`mien animate`: a head animated by a timeline, to a video, pictures, a model or numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from mien.animate.perform import frame_times, moved_camera
from mien.animate.timeline import Moment, Timeline
from mien.arrays import Array, UInt8
from mien.errors import FileFormatError, InputError
from mien.head import NEUTRAL, Head
from mien.io.files.atomic import check_file_place, check_files_apart
from mien.io.timeline.timeline_file import check_timeline, load_timeline, timeline_files
from mien.progress import Progress, StepProgress, no_progress, stage_progress
from mien.render.picture import GREY, HeadRenderer
from mien.rig.state import FaceState
from mien.rig.unit_decomposition import units_from_state

SIZE = (720, 900)
"""Of pictures, px, unless the timeline or the user says."""
STAGE = "Animating"


@dataclass(frozen=True)
class AnimationResult:
    """Result of animate_head.

    Attributes:
        frames: number of frames written.
        notes: for the user, such as weights that extrapolate the photographed expressions.
    """

    frames: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Job:
    """One head, timeline and camera."""

    renderer: HeadRenderer
    timeline: Timeline
    fps: float
    size: tuple[int, int]
    yaw: float
    pitch: float
    background: tuple[int, int, int] | None
    progress: StepProgress = field(repr=False)

    @cached_property
    def times(self) -> Array:
        return frame_times(self.timeline, self.fps)

    def moments(self) -> Iterator[Moment]:
        """One a frame; reports progress."""
        times = self.times
        self.progress(0, len(times))
        for index, moment in enumerate(self.timeline.moments_at(times), 1):
            yield moment
            self.progress(index, len(times))

    def pictures(self, background: tuple[int, int, int] | None) -> Iterator[UInt8[Array, "h w c"]]:
        """One a frame: with alpha where there is no background."""
        camera = self.renderer.camera(self.yaw, self.pitch, size=self.size)
        for moment in self.moments():
            seen_from = moved_camera(camera, moment)
            picture = self.renderer.draw(moment.state, seen_from, background=background)
            yield picture if background is None else np.ascontiguousarray(picture[..., :3])


def animate_head(
    head: Head,
    timeline: Timeline | str | Path,
    path: str | Path,
    *,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    yaw: float = 0.0,
    pitch: float = 0.0,
    background: tuple[int, int, int] | None = None,
    read: Iterable[str | Path] = (),
    progress: Progress | None = None,
) -> AnimationResult:
    """Animate a head by a timeline, to a video, pictures, a model or a table.

    Frames are made one at a time; an existing file stays until the new one is complete.

    Args:
        head: the head.
        timeline: or a file that holds one (mien.io.load_timeline).
        path: what to write, by its suffix: .mp4, .webm, .glb, .usdz, .csv (Live Link Face), .fap
            (MPEG-4); a name without one, or with a slash at its end, is a folder of pictures.
        fps: frames a second; the timeline's unless given.
        size: width and height of pictures, px; the timeline's unless given.
        yaw: radians, pose of the head at rest; for pictures.
        pitch: as `yaw`.
        background: sRGB. Unless given, pictures and .webm have alpha and an .mp4 a plain grey.
        read: further inputs, such as the head's folder, which must not be overwritten.
        progress: called with the stage, frames done and their total.

    Returns:
        How many frames were written, and notes for the user.

    Raises:
        InputError: another suffix, a path that is an input or cannot be written, a rate that a
            .fap cannot have.
        FileFormatError: the timeline; channels that the head lacks, by place; more than
            MAX_FRAMES.
    """
    files = [] if isinstance(timeline, Timeline) else timeline_files(timeline)
    write = _writer(path, [*files, *read])
    name = timeline if isinstance(timeline, (str, Path)) else "timeline"
    played = timeline if isinstance(timeline, Timeline) else load_timeline(timeline)
    check_timeline(played, expressions=head.expressions, units=head.unit_names, path=name)
    job = _Job(
        renderer=HeadRenderer(head),
        timeline=played,
        fps=played.fps if fps is None else fps,
        size=size or played.size or SIZE,
        yaw=yaw,
        pitch=pitch,
        background=background,
        progress=stage_progress(progress or no_progress, STAGE),
    )
    try:
        _ = job.times
    except InputError as error:
        problem = f"expected {error.expected}, found {error.got}"
        raise FileFormatError(name, problem, error.name) from None
    notes = (*played.notes, *_hull_notes(job, name))
    return AnimationResult(write(job, path), notes)


def _hull_notes(job: _Job, name: str | Path) -> tuple[str, ...]:
    """Notes on weights that extrapolate the expressions, with the time of the largest excess.

    Raises:
        FileFormatError: weights out of range, with their time.
    """
    rig = job.renderer.rig
    farthest: dict[str, tuple[float, float, Mapping[str, float]]] = {}
    for moment in job.timeline.moments_at(job.times):
        try:
            rig.hull_notes(moment.state)
        except InputError as error:
            raise FileFormatError(name, str(error), f"at {moment.time:.2f} s") from None
        for region, weights in moment.state.expressions.items():
            excess = _excess(weights)
            if region not in farthest or excess > farthest[region][0]:
                farthest[region] = excess, moment.time, weights
    return tuple(
        f"{note} at {time:.2f} s"
        for region, (_, time, weights) in farthest.items()
        for note in rig.hull_notes(FaceState({region: weights}))
    )


def _excess(weights: Mapping[str, float]) -> float:
    """Largest excess of a weight, neutral's included, over 0 to 1; negative inside."""
    given = list(weights.values())
    every = given if NEUTRAL in weights else [1 - sum(given), *given]
    return max(max(-weight, weight - 1) for weight in every)


def _writer(path: str | Path, read: Iterable[str | Path]) -> Callable[[_Job, str | Path], int]:
    """The function that writes this kind of file, by suffix.

    Raises:
        InputError: unknown suffix, a path that is an input, a folder with other files.
    """
    from mien.io.files.frames import check_frames_place

    suffix = Path(path).suffix.lower()
    if str(path).endswith("/") or not suffix:
        check_frames_place(path, read=read)
        return _write_pictures
    if suffix not in _WRITERS:
        kinds = f"a name that ends in {', '.join(_WRITERS)}, or a folder's"
        raise InputError(path, kinds, suffix)
    check_files_apart([path], read)
    check_file_place(path)
    return _WRITERS[suffix]


def _write_pictures(job: _Job, path: str | Path) -> int:
    from mien.io.files.frames import save_frames

    return save_frames(path, job.pictures(job.background))


def _write_video(job: _Job, path: str | Path) -> int:
    from mien.io.files.video import save_video

    opaque = Path(path).suffix.lower() == ".mp4"
    background = job.background or (GREY if opaque else None)
    return save_video(path, job.pictures(background), job.fps)


def _write_model(job: _Job, path: str | Path) -> int:
    from mien.io.mesh.animation_baking import bake_animation
    from mien.io.mesh.export import export_head

    animation = bake_animation(job.renderer.head, job.moments(), job.renderer.rig.evaluate)
    export_head(job.renderer.head, path, animation=animation)
    return len(animation.times)


def _write_live_link(job: _Job, path: str | Path) -> int:
    from mien.io.live.live_link_csv import save_live_link

    head = job.renderer.head
    return save_live_link(path, job.moments(), units_of=lambda state: units_from_state(head, state))


def _write_fap(job: _Job, path: str | Path) -> int:
    from mien.io.timeline.fap import FapMeter, save_fap

    meter = FapMeter.of(job.renderer.head.mesh.vertices)
    values = (
        meter.read(job.renderer.rig.evaluate(moment.state).vertices, moment.rotation)
        for moment in job.moments()
    )
    return save_fap(path, values, job.fps)


_WRITERS: dict[str, Callable[[_Job, str | Path], int]] = {
    ".mp4": _write_video,
    ".webm": _write_video,
    ".glb": _write_model,
    ".usdz": _write_model,
    ".csv": _write_live_link,
    ".fap": _write_fap,
}
