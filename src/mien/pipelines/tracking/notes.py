"""Notes for the user on the frames of a track."""

from __future__ import annotations

from pathlib import Path
from statistics import median

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.faces.landmarks import is_cut
from mien.errors import EstimationError
from mien.head import Head
from mien.pipelines.head_in_photo import UNLIKE
from mien.track.state import Track, TrackedFrame
from mien.track.tracker import MISMATCH_RMS

_OTHER_FACES = (
    "faces were there, none like the head's: another person's, covered, or in other light"
)


def track_notes(track: Track, head: Head, *, other_faces_seen: bool) -> list[str]:
    """How many frames are lost or cut, and whether the face looks like the head's.

    Args:
        track: of the head.
        head: that was tracked.
        other_faces_seen: whether in a lost frame there was a face.
    """
    notes = []
    lost = [frame for frame in track.frames if frame.state is None]
    if lost:
        why = f"; {_OTHER_FACES}" if other_faces_seen else ""
        notes.append(f"the face is lost in {_counted(lost, track)}{why}")
    landmarks = load_generic_head().landmark_positions(head.mesh.vertices)
    cut = [frame for frame in track.frames if _is_cut(frame, track, landmarks)]
    if cut:
        notes.append(f"the edge cuts the face in {_counted(cut, track)}; outside is a guess")
    errors = [frame.rms for frame in track.frames if frame.state is not None]
    if errors and median(errors) > MISMATCH_RMS:
        notes.append(f"{UNLIKE}: error {median(errors):.0f} grey levels, usual are 2 to 13")
    return notes


def check_not_all_lost(
    track: Track, video: str | Path, table: Path | None, *, other_faces_seen: bool
) -> None:
    """Refuse a track whose frames are all lost.

    Args:
        track: of the video.
        video: that the message names.
        table: where the track is written, if it is.
        other_faces_seen: whether in a lost frame there was a face.

    Raises:
        EstimationError: the head is in no frame.
    """
    if not track.frames or any(frame.state for frame in track.frames):
        return
    reason = _OTHER_FACES if other_faces_seen else "no face was there"
    written = "" if table is None else f"; {table} says so of each"
    raise EstimationError(
        f"{video}: expected the head's face, found in none of {len(track.frames)} frames: "
        f"{reason}{written}"
    )


def _counted(frames: list[TrackedFrame], track: Track) -> str:
    return f"{len(frames)} of {len(track.frames)} frames, at {frames[0].time:.2f} s first"


def _is_cut(frame: TrackedFrame, track: Track, landmarks: Float[Array, "n 3"]) -> bool:
    """Whether some of the head's landmarks, in its neutral face, lie outside of the picture."""
    if frame.state is None:
        return False
    size = (track.width, track.height)
    state = frame.state
    camera = Camera(*size, track.focal_px, state.R_cam_head, state.t_cam_head)
    in_front = camera.to_camera(landmarks)[:, 2] > 0
    return bool(in_front.all()) and is_cut(np.asarray(camera.project(landmarks)), size)
