from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from filmed import written
from mien.arrays import Array
from mien.capture.clip_notes import ClipNotes, quarters_to_upright
from mien.capture.detector import LandmarkDetector
from mien.capture.face_series import find_faces
from mien.capture.picked_frames import pick_frames
from mien.errors import EstimationError
from mien.numeric.rotation import rotation_from_vector

UPRIGHT = np.diag([1.0, -1.0, -1.0])
TURNS = {
    1: "the face lies on its side in the clip: turn it by 90 degrees clockwise",
    2: "the face stands on its head in the clip: turn it by 180 degrees",
    3: "the face lies on its side in the clip: turn it by 90 degrees counterclockwise",
}
"""By quarters counterclockwise that a clip was turned by."""


def noted(detector: LandmarkDetector, frames: list[Array]) -> list[str]:
    odd = ClipNotes(detector)
    for pixels in frames:
        odd.look(pixels, detector.all_fast(np.ascontiguousarray(pixels)))
    return odd.notes


@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize("yaw", [-0.6, 0.0, 0.6])
def test_quarters_from_a_rotation(quarters: int, yaw: float) -> None:
    """A picture that was turned counterclockwise, y down, has turned what it shows by minus z."""
    turned = rotation_from_vector(np.array([0.0, 0.0, -np.pi / 2 * quarters]))
    upright = UPRIGHT @ rotation_from_vector(np.array([0.1, yaw, 0.15]))
    assert quarters_to_upright(turned @ upright) == -quarters % 4


def test_an_ordinary_clip_has_no_notes(detector: LandmarkDetector, faces: dict[str, Array]) -> None:
    assert noted(detector, [faces["left"], faces["right"]] * 4) == []


@pytest.mark.parametrize("quarters", TURNS)
def test_a_clip_that_does_not_stand_upright(
    detector: LandmarkDetector, faces: dict[str, Array], quarters: int
) -> None:
    turned = [np.rot90(faces[side], quarters) for side in ("left", "right")]
    assert TURNS[quarters] in noted(detector, turned * 4)


def test_cut_faces_and_company_are_counted(
    detector: LandmarkDetector, faces: dict[str, Array]
) -> None:
    whole = faces["right"]
    points = detector.detect_fast(whole).points
    cut = whole[: int(points[:, 1].max() - 0.2 * np.ptp(points[:, 1]))]
    both = np.concatenate([whole, faces["left"]], axis=1)
    assert noted(detector, [cut, whole, both, cut, whole]) == [
        "several faces in 1 of 5 frames: the largest of each is used",
        "the edge cuts the face in 2 of 5 frames",
    ]


@pytest.mark.parametrize("command", [find_faces, pick_frames])
def test_said_of_a_video(
    command: Callable[..., object],
    detector: LandmarkDetector,
    faces: dict[str, Array],
    tmp_path: Path,
) -> None:
    turned = [np.rot90(faces[side], 2) for side in ("left", "right")] * 4
    asked = {"detector": detector} | ({"max_side": 800} if command is find_faces else {})
    clip = written(tmp_path / "a.mp4", [*turned, faces["left"]])
    assert any(note.endswith(TURNS[2]) for note in command(clip, **asked).notes)


@pytest.mark.parametrize("command", [find_faces, pick_frames])
def test_said_of_a_video_in_which_no_face_is_found_for_it(
    command: Callable[..., object],
    detector: LandmarkDetector,
    faces: dict[str, Array],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The detector takes some faces that stand on their heads for others, upright ones."""
    clip = written(tmp_path / "a.mp4", [np.rot90(faces["left"], 2)] * 4)
    asked = {"detector": detector} | ({"max_side": 800} if command is find_faces else {})
    seen = detector.all_fast
    monkeypatch.setattr(detector, "all_fast", lambda pixels: seen(pixels)[1:])
    with monkeypatch.context() as patch:
        patch.setattr(ClipNotes, "_look_closely", lambda odd, pixels: odd._standing.update([2]))
        with pytest.raises(EstimationError, match=r"no face found in any .*on its head"):
            command(clip, **asked)
