"""The frames of a video that serve as photos."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mien.arrays import Array, Int, check_positive
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.frame_faces import FrameFaces
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.capture.faces.sharpness import face_sharpness
from mien.capture.images.photos import DEFAULT_MAX_SIDE, Photo
from mien.capture.video.clip_notes import ClipNotes
from mien.capture.video.expression_selection import choose_expressions, name_expressions
from mien.capture.video.frame_photos import fetch_frames
from mien.capture.video.frame_selection import FrameScores, choose_frames
from mien.capture.video.orientation import turn_upright
from mien.capture.video.video import Video
from mien.errors import EstimationError
from mien.head import NEUTRAL
from mien.progress import StepProgress

MAX_SAMPLES = 240
# Just under a tenth, so that rounded times of a 10 Hz clip do not skip frames.
_SAMPLE_SECONDS = 0.099
_ANALYSIS_SIDE = 640


@dataclass(frozen=True)
class PickedFrames:
    """The frames of a clip that are chosen for a head.

    Attributes:
        expressions: photos by expression, "neutral" first. Photos are called `frame_000123.png` by
            the frame's number from 0.
        notes: what was clip_notes.
    """

    expressions: dict[str, tuple[Photo, ...]]
    notes: tuple[str, ...]


def pick_frames(
    path: str | Path,
    *,
    count: int = 7,
    expressions: int | None = None,
    detector: LandmarkDetector,
    max_side: int = DEFAULT_MAX_SIDE,
    progress: StepProgress | None = None,
) -> PickedFrames:
    """Sharp frames with diverse poses of the head at rest, and one of each other expression.

    The clip is decoded twice: once to score up to 240 frames (10 a second at most), once to fetch
    the chosen ones, so that memory stays small however long and large it is.

    Args:
        path: the clip.
        count: how many of neutral at most; fewer when the head turns little.
        expressions: how many others at most; None takes those that differ, up to 8; 0 none.
        detector: finds the face.
        max_side: px; larger frames are reduced to it.
        progress: called with (done, total) frames of both passes; the total is an estimate.

    Raises:
        InputError: no such file, not readable, `count` not positive.
        FileFormatError: not a video, or no frame in it.
        EstimationError: no face in any frame.
    """
    check_positive("count", count)
    video = Video(Path(path))
    turn_upright(video, detector)
    report = _two_passes(progress, video.info().frames)
    scores = _score_frames(video, detector, report)
    rows = _choose_rows(scores, count, expressions)
    wanted = {int(scores.index[row]) for chosen in rows.values() for row in chosen}
    photos = dict(fetch_frames(video, wanted, max_side, lambda frame: report(1, frame)))
    picked = {
        name: tuple(photos[index] for index in scores.index[chosen].tolist() if index in photos)
        for name, chosen in rows.items()
    }
    neutral = rows[NEUTRAL]
    span = f"the head turns by {np.degrees(np.ptp(scores.pose[neutral, 0])):.0f} degrees in them"
    video.notes.append(f"{len(neutral)} of {len(scores.index)} judged frames chosen: {span}")
    others = [name for name in rows if name != NEUTRAL]
    if others:
        what = f"other expression{'s' * (len(others) > 1)} chosen"
        video.notes.append(f"{len(others)} {what}: {', '.join(others)}")
    return PickedFrames(picked, tuple(video.notes))


def _choose_rows(
    scores: FrameScores, count: int, expressions: int | None
) -> dict[str, Int[Array, " n"]]:
    """Rows of the scores by expression."""
    neutral = choose_frames(scores, count)
    at_rest = int(neutral[np.abs(scores.pose[neutral]).sum(axis=1).argmin()])
    others = choose_expressions(scores, at_rest, expressions)
    names = name_expressions(scores.blendshapes[others], scores.blendshapes[at_rest])
    return {NEUTRAL: neutral} | {
        name: np.array([row]) for name, row in zip(names, others, strict=True)
    }


def _two_passes(progress: StepProgress | None, frames: int) -> StepProgress:
    """Progress of pass 0 or 1 at a frame as (done, total) of both."""
    if progress is None:
        return lambda step, frame: None

    def report(step: int, frame: int) -> None:
        total = 2 * max(frames, frame + 1)
        progress(min(step * total // 2 + frame + 1, total), total)

    return report


def _score_frames(video: Video, detector: LandmarkDetector, report: StepProgress) -> FrameScores:
    """Scores of the frames, evenly spread in time, that show a face."""
    step = max(_SAMPLE_SECONDS, (video.info().seconds or 0) / MAX_SAMPLES)
    rows: list[tuple[int, float, DetectedFace]] = []
    clip_notes, finder = ClipNotes(), FrameFaces(detector, _ANALYSIS_SIDE)
    due = -np.inf
    for frame in video.frames():
        report(0, frame.index)
        # A clock that jumps back (a joined clip) must not end the sampling.
        if due - 2 * step < frame.seconds < due:
            continue
        due = frame.seconds + step
        pixels = frame.pixels()
        faces = finder.find(pixels)
        clip_notes.add_frame(pixels, faces)
        if faces:
            sharpness = face_sharpness(pixels, faces[0].points[:, :2])
            rows.append((frame.index, sharpness, faces[0]))
    if not rows:
        raise EstimationError(f"{video.path}: no face found in any of its frames")
    video.notes += clip_notes.notes
    return FrameScores.of(*zip(*rows, strict=True))
