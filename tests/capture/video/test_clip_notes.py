from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from filmed import written
from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.face_series import find_faces
from mien.capture.video.picked_frames import pick_frames


@pytest.fixture(scope="module")
def cut(detector: LandmarkDetector, faces: dict[str, Array]) -> Array:
    """A photo that ends between the mouth and the chin."""
    points = detector.detect_fast(faces["right"]).points
    end = points[:, 1].max() - 0.2 * np.ptp(points[:, 1])
    return faces["right"][: int(end) // 2 * 2]


@pytest.mark.parametrize("command", [find_faces, pick_frames])
def test_faces_that_the_edge_cuts_are_counted(
    command: Callable[..., object],
    detector: LandmarkDetector,
    faces: dict[str, Array],
    cut: Array,
    tmp_path: Path,
) -> None:
    asked = {"detector": detector} | ({"max_side": 800} if command is find_faces else {})
    found = command(written(tmp_path / "a.mp4", [cut] * 5), **asked)
    (note,) = [note for note in found.notes if "edge" in note]
    assert note.endswith("the edge cuts the face in 5 of 5 frames")
    whole = command(written(tmp_path / "b.mp4", [faces["right"]] * 3), **asked)
    assert not [note for note in whole.notes if "edge" in note or "several" in note]


@pytest.mark.parametrize("command", [find_faces, pick_frames])
def test_frames_with_several_faces_are_counted(
    command: Callable[..., object],
    detector: LandmarkDetector,
    faces: dict[str, Array],
    tmp_path: Path,
) -> None:
    both = np.concatenate([faces["right"], faces["left"]], axis=1)
    alone = np.concatenate([faces["right"], np.full_like(faces["left"], 90)], axis=1)
    asked = {"detector": detector} | ({"max_side": 1200} if command is find_faces else {})
    found = command(written(tmp_path / "a.mp4", [alone, both, both, alone]), **asked)
    (note,) = [note for note in found.notes if "several" in note]
    assert note.endswith("several faces in 2 of 4 frames: the largest of each is used")
