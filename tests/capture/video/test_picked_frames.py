from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from clips import scored
from filmed import grey, written
from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector, NoFaceError
from mien.capture.faces.landmarks import Landmarks
from mien.capture.faces.mediapipe_face import LOWER_LIP, UPPER_LIP, DetectedFace
from mien.capture.images.photos import Photo
from mien.capture.video.picked_frames import pick_frames
from mien.errors import EstimationError, InputError


@pytest.fixture(scope="module")
def small(faces: dict[str, Array]) -> dict[str, Array]:
    return {
        side: cv2.resize(pixels, (300, 400), interpolation=cv2.INTER_AREA)
        for side, pixels in faces.items()
    }


def test_sharp_frames_of_both_poses_are_picked(
    tmp_path: Path, small: dict[str, Array], detector: LandmarkDetector
) -> None:
    blurred = {side: cv2.GaussianBlur(pixels, (0, 0), 1.5) for side, pixels in small.items()}
    path = written(
        tmp_path / "a.mp4",
        [*[blurred["left"]] * 2, small["left"], *[blurred["right"]] * 2, small["right"]],
    )
    seen: list[tuple[int, int]] = []
    picked = pick_frames(
        path, count=7, detector=detector, progress=lambda done, total: seen.append((done, total))
    )
    assert list(picked.expressions) == ["neutral"]
    photos = picked.expressions["neutral"]
    assert [photo.name for photo in photos] == ["frame_000002.png", "frame_000005.png"]
    assert np.abs(photos[0].pixels.astype(int) - small["left"]).mean() < 3
    assert picked.notes == ("2 of 6 judged frames chosen: the head turns by 44 degrees in them",)
    assert seen == sorted(seen)
    assert all(done <= total for done, total in seen)


PLAYED = {40: scored(), 80: scored(mouthSmile=0.9), 120: scored(jawOpen=0.7)}
"""What an actor does in grey frames."""


class Audience:
    """A detector that sees the actor in them."""

    def detect(self, photo: Photo, *, face: int | None = None) -> Landmarks:
        raise NoFaceError(photo.name)

    def detect_in_tiles(self, pixels: Array) -> list[DetectedFace]:
        return []

    def detect_all_fast(self, pixels: Array) -> list[DetectedFace]:
        level = 40 * round(pixels.mean() / 40)
        if level not in PLAYED:
            return []
        points = np.random.default_rng(0).uniform(0, 48, size=(478, 3))
        points[UPPER_LIP] = points[LOWER_LIP]
        return [DetectedFace(points, PLAYED[level], np.diag([1.0, -1.0, -1.0]))]


@pytest.mark.parametrize(
    ("count", "names"),
    [(None, ["neutral", "smile", "open_mouth"]), (1, ["neutral", "smile"]), (0, ["neutral"])],
)
def test_expressions_are_picked_and_named(
    tmp_path: Path, count: int | None, names: list[str]
) -> None:
    path = written(tmp_path / "a.mp4", grey([40, 40, 200, 80, 40, 120]))
    picked = pick_frames(path, expressions=count, detector=Audience())
    assert list(picked.expressions) == names
    levels = {"neutral": 40, "smile": 80, "open_mouth": 120}
    for name, photos in picked.expressions.items():
        (photo,) = photos
        assert photo.pixels.mean() == pytest.approx(levels[name], abs=3)
    if count is None:
        assert picked.expressions["smile"][0].name == "frame_000003.png"
        assert picked.notes == (
            "1 of 5 judged frames chosen: the head turns by 0 degrees in them",
            "2 other expressions chosen: smile, open_mouth",
        )


def test_no_face_in_any_frame(tmp_path: Path, detector: LandmarkDetector) -> None:
    path = written(tmp_path / "a.mp4", grey([10, 20, 30]))
    with pytest.raises(EstimationError, match=r"a\.mp4: no face found in any of its frames"):
        pick_frames(path, detector=detector)
    with pytest.raises(InputError, match="count: expected a number above zero"):
        pick_frames(path, count=0, detector=detector)


def test_real_clip(shared: Path, detector: LandmarkDetector) -> None:
    clip = shared / "data/videos/single_face.mp4"
    photos = pick_frames(clip, count=3, detector=detector).expressions["neutral"]
    assert 1 <= len(photos) <= 3
    assert photos[0].size == (640, 360)
