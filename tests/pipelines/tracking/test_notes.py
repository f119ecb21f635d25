"""What is said of tracks whose frames are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mien.camera import FRONTAL
from mien.errors import EstimationError
from mien.head import Head
from mien.pipelines.tracking.notes import check_not_all_lost, track_notes
from mien.track.state import Track, TrackedFrame, TrackState
from posable import head
from tracks import LAYOUT

HEAD: Head = head()
WIDTH, HEIGHT, FOCAL = 640, 480, 800.0


def shown(number: int, x: float = 0.0, rms: float = 5.0) -> TrackedFrame:
    """A frame of a head that faces the camera from 800 mm, so many mm to the side."""
    weights = np.zeros((len(LAYOUT.regions), len(LAYOUT.expressions)))
    weights[:, 0] = 1
    state = TrackState(
        FRONTAL, np.array([x, 0.0, 800.0]), weights, np.zeros(len(LAYOUT.units)), np.zeros(2)
    )
    unknown = np.zeros(len(LAYOUT.channels))
    return TrackedFrame(
        number, number / 10, "ok", state, rms, 0.9, unknown, np.ones(3), np.zeros(3)
    )


def lost(number: int) -> TrackedFrame:
    return replace(shown(number), status="lost", state=None, rms=np.nan)


def track_of(*frames: TrackedFrame) -> Track:
    return Track(LAYOUT, WIDTH, HEIGHT, FOCAL, 10.0, frames)


def said(*frames: TrackedFrame, other_faces_seen: bool = False) -> list[str]:
    return track_notes(track_of(*frames), HEAD, other_faces_seen=other_faces_seen)


def test_ordinary_track_has_no_notes() -> None:
    assert said(shown(0), shown(1, 50.0), shown(2, -120.0)) == []


def test_lost_and_cut_frames_are_counted() -> None:
    """The picture ends 320 mm to either side; a face is some 150 wide."""
    assert said(shown(0), shown(1, 300.0), lost(2), lost(3), shown(4, -320.0)) == [
        "the face is lost in 2 of 5 frames, at 0.20 s first",
        "the edge cuts the face in 2 of 5 frames, at 0.10 s first; outside is a guess",
    ]


def test_note_on_other_faces() -> None:
    (note,) = said(shown(0), lost(1), other_faces_seen=True)
    assert note == (
        "the face is lost in 1 of 2 frames, at 0.10 s first; faces were there, none like the "
        "head's: another person's, covered, or in other light"
    )


def test_note_on_a_median_error_that_is_too_large() -> None:
    assert said(shown(0), shown(1), shown(2, rms=60.0)) == []
    assert said(shown(0), shown(1, rms=31.0), shown(2, rms=60.0)) == [
        "the face does not look like the head's: another person's, or in other light: error 31 "
        "grey levels, usual are 2 to 13"
    ]


@pytest.mark.parametrize(
    ("other_faces_seen", "table", "message"),
    [
        (False, None, r"^a\.mp4: expected .*, found in none of 2 frames: no face was there$"),
        (True, Path("t.csv"), r"frames: faces were there, none like .*; t\.csv says so of each$"),
    ],
)
def test_all_lost(other_faces_seen: bool, table: Path | None, message: str) -> None:
    with pytest.raises(EstimationError, match=message):
        check_not_all_lost(
            track_of(lost(0), lost(1)), "a.mp4", table, other_faces_seen=other_faces_seen
        )
    check_not_all_lost(
        track_of(lost(0), shown(1)), "a.mp4", table, other_faces_seen=other_faces_seen
    )
    check_not_all_lost(track_of(), "a.mp4", table, other_faces_seen=other_faces_seen)
