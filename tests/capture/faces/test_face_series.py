"""Every picture of a face: what is found in photos and frames, and what pictures are called."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from filmed import grey, written
from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.face_series import FaceSeries, find_faces, load_pictures, row_of, rows_of
from mien.capture.faces.sharpness import face_sharpness
from mien.capture.video.frame_selection import FrameScores
from mien.errors import EstimationError, FileFormatError, InputError


@pytest.fixture(scope="module")
def small(faces: dict[str, Array]) -> dict[str, Array]:
    return {
        side: cv2.resize(pixels, (300, 400), interpolation=cv2.INTER_AREA)
        for side, pixels in faces.items()
    }


@pytest.fixture
def folder(tmp_path: Path, small: dict[str, Array]) -> Path:
    """Two photos of a face and one of a wall."""
    for name, pixels in small.items():
        Image.fromarray(pixels).save(tmp_path / f"{name}.png")
    Image.fromarray(grey([90])[0]).save(tmp_path / "wall.png")
    return tmp_path


def test_a_folder_of_photos(folder: Path, detector: LandmarkDetector) -> None:
    seen: list[tuple[int, ...]] = []
    told: list[tuple[int, int]] = []
    series = find_faces(
        folder,
        detector,
        max_side=200,
        on_picture=lambda pixels, landmarks: seen.append((*pixels.shape, *landmarks.shape)),
        progress=lambda done, total: told.append((done, total)),
    )
    assert (series.is_video, series.names) == (False, ("left.png", "right.png"))
    assert list(series.left_out) == ["wall.png"]
    assert series.left_out["wall.png"].startswith("no face found")
    assert seen == [(200, 150, 3, 478, 2)] * 2
    assert told == [(1, 3), (2, 3), (3, 3)]
    np.testing.assert_array_equal(series.sizes, [[150, 200]] * 2)
    assert "left.png, right.png: scaled from 300x400 to 150x200" in series.notes
    # Landmarks are in px of what comes when the pictures are asked for.
    (row, photo), *_ = load_pictures(series, [1])
    assert (row, photo.name, photo.size) == (1, "right.png", (150, 200))
    assert (series.landmarks[1] > 0).all()
    assert (series.landmarks[1] < [150, 200]).all()


def test_folders_of_expressions(folder: Path, detector: LandmarkDetector) -> None:
    for name, photo in (("neutral", "left"), ("joy", "right")):
        (folder / name).mkdir()
        shutil.move(folder / f"{photo}.png", folder / name / "a.png")
    (folder / "wall.png").unlink()
    series = find_faces(folder, detector, max_side=400)
    assert series.names == ("neutral/a.png", "joy/a.png")
    assert row_of(series, "joy/a", "--neutral") == 1
    with pytest.raises(InputError, match="--neutral: expected one picture, got 'a', which names 2"):
        row_of(series, "a", "--neutral")


def test_a_video(tmp_path: Path, small: dict[str, Array], detector: LandmarkDetector) -> None:
    wall = np.full_like(small["left"], 90)
    clip = written(tmp_path / "a.mp4", [wall, small["left"], wall, small["right"]])
    series = find_faces(clip, detector, max_side=400)
    assert series.names == ("frame_000001.png", "frame_000003.png")
    assert series.left_out == dict.fromkeys(
        ("frame_000000.png", "frame_000002.png"), "no face found"
    )
    assert series.seconds is not None
    np.testing.assert_allclose(series.seconds, [0.1, 0.3], atol=1e-6)
    photos = dict(load_pictures(series, [1, 0]))
    assert np.abs(photos[1].pixels.astype(int) - small["right"]).mean() < 4
    assert list(photos) == [0, 1]


def test_no_face_anywhere(tmp_path: Path, detector: LandmarkDetector) -> None:
    Image.fromarray(grey([90])[0]).save(tmp_path / "wall.png")
    with pytest.raises(EstimationError, match=r"no face found in any of its photos \(wall.png: no"):
        find_faces(tmp_path, detector, max_side=400)
    clip = written(tmp_path / "a.mp4", grey([10, 20]))
    with pytest.raises(EstimationError, match=r"a.mp4: no face found in any of its frames"):
        find_faces(clip, detector, max_side=400)


def test_sources_that_are_none(tmp_path: Path, detector: LandmarkDetector) -> None:
    with pytest.raises(InputError, match="a photo, a video or a folder of photos, got nothing"):
        find_faces(tmp_path / "nowhere", detector, max_side=400)
    (tmp_path / "a.mp4").write_text("a film")
    with pytest.raises(FileFormatError, match="expected a video, found a text file"):
        find_faces(tmp_path / "a.mp4", detector, max_side=400)


def test_a_face_of_a_video_cannot_be_chosen(tmp_path: Path, detector: LandmarkDetector) -> None:
    clip = written(tmp_path / "a.mp4", grey([10, 20]))
    with pytest.raises(InputError, match=r"--face: expected photos to choose a face in, got a vid"):
        find_faces(clip, detector, max_side=400, face=1)


def made_up(*, video: bool) -> FaceSeries:
    numbers = np.array([0, 12, 40])
    names = [f"frame_{n:06d}.png" for n in numbers] if video else ["12.jpg", "a.jpg", "b.jpg"]
    return FaceSeries(
        source=Path("a.mp4" if video else "photos"),
        is_video=video,
        files=(),
        names=tuple(names),
        landmarks=np.zeros((3, 478, 2)),
        sizes=np.ones((3, 2), int),
        scores=FrameScores(numbers, np.ones(3), np.zeros((3, 2)), np.zeros((3, 52)), np.zeros(3)),
        seconds=None,
        max_side=100,
        left_out={"frame_000001.png" if video else "wall.jpg": "no face found"},
        notes=(),
    )


@pytest.mark.parametrize("name", ["12", "frame_000012", "frame_000012.png"])
def test_what_frames_are_called(name: str) -> None:
    assert row_of(made_up(video=True), name, "--include") == 1


def test_what_photos_are_called() -> None:
    assert row_of(made_up(video=False), "12", "--include") == 0
    assert row_of(made_up(video=False), "b.jpg", "--include") == 2


def test_ranges_of_frames() -> None:
    assert rows_of(made_up(video=True), "10-40", "--exclude") == [1, 2]
    assert rows_of(made_up(video=True), "12", "--exclude") == [1]
    with pytest.raises(InputError, match="a stretch of frames that show the face, got 13-20"):
        rows_of(made_up(video=True), "13-20", "--exclude")
    with pytest.raises(InputError, match="the name of a photo"):
        rows_of(made_up(video=False), "1-5", "--exclude")


@pytest.mark.parametrize(
    ("video", "name", "message"),
    [
        (
            True,
            "99",
            "--include: expected the number of a frame, from 0 to 40, or its name, got frame_00",
        ),
        (
            True,
            "1",
            "--include: expected a picture that shows the face, got frame_000001.png: no f",
        ),
        (False, "c", "--include: expected the name of a photo (12.jpg, a.jpg, b.jpg), got c"),
        (False, "wall", "--include: expected a picture that shows the face, got wall.jpg: no face"),
    ],
)
def test_pictures_that_are_not_there(video: bool, name: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        row_of(made_up(video=video), name, "--include")
    assert str(caught.value).startswith(message)


def test_blur_and_blocks_make_a_face_less_sharp(rng: np.random.Generator) -> None:
    pixels = rng.integers(0, 256, (96, 96, 3), np.uint8)
    pixels = cv2.GaussianBlur(pixels, (0, 0), 1.0)
    corners = np.array([[16.0, 16.0], [80.0, 80.0]])
    sharp = face_sharpness(pixels, corners)
    assert face_sharpness(cv2.GaussianBlur(pixels, (0, 0), 2.0), corners) < 0.5 * sharp
    blocks = np.repeat(np.repeat(pixels[::8, ::8], 8, axis=0), 8, axis=1)
    assert face_sharpness(blocks, corners) < 0.5 * sharp
    assert face_sharpness(pixels, corners + 1000) == 0
