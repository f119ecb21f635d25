"""Clips that lie or stand on their head are turned, and it is said; others are left alone."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from filmed import flagged, grey, written
from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.face_series import find_faces, load_pictures
from mien.capture.video.orientation import turn_upright
from mien.capture.video.picked_frames import pick_frames
from mien.capture.video.video import Video

NOTES = {
    0: [],
    1: ["its pictures lie on their side: they are turned by 90 degrees counterclockwise"],
    2: ["its pictures are upside-down: they are turned by 180 degrees"],
    3: ["its pictures lie on their side: they are turned by 90 degrees clockwise"],
}


@pytest.fixture(scope="module")
def face(faces: dict[str, Array]) -> Array:
    return cv2.resize(faces["left"], (300, 400), interpolation=cv2.INTER_AREA)


def lying(path: Path, face: Array, quarters: int, count: int = 8) -> Path:
    """A clip that so many quarters counterclockwise make upright."""
    return written(path, [np.ascontiguousarray(np.rot90(face, -quarters))] * count)


@pytest.mark.parametrize("quarters", range(4))
def test_turned_until_the_head_is_upright(
    tmp_path: Path, face: Array, detector: LandmarkDetector, quarters: int
) -> None:
    video = Video(lying(tmp_path / "a.mp4", face, quarters))
    assert turn_upright(video, detector) == bool(quarters)
    assert video.notes == NOTES[quarters]
    assert (video.info().width, video.info().height) == (300, 400)
    frame = next(video.frames())
    assert np.abs(frame.pixels().astype(int) - face).mean() < 4
    assert frame.size == (300, 400)


@pytest.mark.parametrize("name", ["cap12_edit", "single_face", "d14"])
@pytest.mark.parametrize("quarters", range(4))
def test_real_clips(shared: Path, detector: LandmarkDetector, name: str, quarters: int) -> None:
    """Lying as they are turned before: an upside-down face is not taken for another one."""
    video = Video(shared / f"data/videos/{name}.mp4", quarters)
    turn_upright(video, detector)
    assert video.quarters == 0


def test_what_the_file_says_comes_first(
    tmp_path: Path, face: Array, detector: LandmarkDetector
) -> None:
    video = Video(flagged(lying(tmp_path / "a.mp4", face, 1), 1))
    assert not turn_upright(video, detector)
    assert np.abs(next(video.frames()).pixels().astype(int) - face).mean() < 4


def test_without_a_face_nothing_is_turned(tmp_path: Path, detector: LandmarkDetector) -> None:
    video = Video(written(tmp_path / "a.mp4", grey([20, 90, 150])))
    assert not turn_upright(video, detector)
    assert not video.notes


def test_examples_and_heads_take_turned_pictures(
    tmp_path: Path, face: Array, detector: LandmarkDetector
) -> None:
    clip = lying(tmp_path / "a.mp4", face, 2)
    series = find_faces(clip, detector, max_side=400)
    assert series.notes == (f"a.mp4: {NOTES[2][0]}",)
    for _, photo in load_pictures(series, [0, 2]):
        assert np.abs(photo.pixels.astype(int) - face).mean() < 4
    picked = pick_frames(clip, detector=detector)
    assert picked.notes[0] == NOTES[2][0]
    assert np.abs(picked.expressions["neutral"][0].pixels.astype(int) - face).mean() < 4
