from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array, check_rotation
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.landmarks import Landmarks
from mien.capture.faces.mediapipe_face import yaw_pitch
from mien.capture.images.photos import Photo
from mien.errors import EstimationError, InputError

AsPhoto = Callable[..., Photo]

RIGHT_CHEEK, LEFT_CHEEK = 234, 454
NOSE_TIP, CHIN, FOREHEAD = 1, 152, 10


def resized(pixels: Array, width: int) -> Array:
    height = round(pixels.shape[0] * width / pixels.shape[1])
    return np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS))


def shift(found: Landmarks, truth: Array) -> float:
    """Median distance in distances between the eyes."""
    return float(np.median(np.linalg.norm(found.points - truth, axis=1)) / found.eye_distance_px)


def test_left_and_right_are_the_subjects(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    left = detector.detect(as_photo(faces["left"]))
    right = detector.detect(as_photo(faces["right"]))
    # One photo shows more of his right cheek, as his head is turned to his left, and vice versa.
    assert np.degrees(yaw_pitch(left.R_cam_head)[0]) == pytest.approx(24, abs=8)
    assert np.degrees(yaw_pitch(right.R_cam_head)[0]) == pytest.approx(-24, abs=10)
    for landmarks in (left, right):
        assert landmarks.points[RIGHT_CHEEK, 0] < landmarks.points[LEFT_CHEEK, 0]
        assert landmarks.points[FOREHEAD, 1] < landmarks.points[CHIN, 1]
        assert landmarks.confidence[NOSE_TIP] > 0.5
        check_rotation("R", landmarks.R_cam_head)
        assert not landmarks.notes
    assert left.confidence[RIGHT_CHEEK] > 0.3
    assert left.confidence[LEFT_CHEEK] == 0
    assert right.confidence[LEFT_CHEEK] > 0.3
    assert right.confidence[RIGHT_CHEEK] == 0


def test_scale_of_the_photo_does_not_matter(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    full = detector.detect(as_photo(faces["left"]))
    half = detector.detect(as_photo(resized(faces["left"], 300)))
    double = detector.detect(as_photo(resized(faces["left"], 1800)))
    assert shift(half, full.points / 2) < 0.02
    assert shift(double, full.points * 3) < 0.02


def test_tiny_face_in_a_large_photo(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    truth = detector.detect(as_photo(faces["left"])).points
    wide = np.full((2400, 3600, 3), 110, np.uint8)
    wide[1500:2300, 2700:3300] = faces["left"]
    found = detector.detect(as_photo(wide))
    assert shift(found, truth + np.array([2700, 1500])) < 0.03


@pytest.mark.parametrize(("quarters", "degrees"), [(1, -90), (2, 180), (3, 90)])
def test_face_on_its_side(
    detector: LandmarkDetector,
    faces: dict[str, Array],
    as_photo: AsPhoto,
    quarters: int,
    degrees: int,
) -> None:
    upright = detector.detect(as_photo(faces["left"]))
    turned = detector.detect(as_photo(np.rot90(faces["left"], quarters)))
    # A quarter turn counterclockwise takes (x, y) of a picture w wide to (y, w - x).
    truth, rotation, size = upright.points, upright.R_cam_head, (600, 800)
    for _ in range(quarters):
        truth = np.column_stack([truth[:, 1], size[0] - truth[:, 0]])
        rotation = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) @ rotation
        size = size[::-1]
    assert shift(turned, truth) < 1e-6
    assert yaw_pitch(turned.R_cam_head) == pytest.approx(yaw_pitch(upright.R_cam_head))
    np.testing.assert_allclose(turned.blendshapes, upright.blendshapes, atol=1e-9)
    np.testing.assert_allclose(turned.confidence, upright.confidence, atol=1e-9)
    np.testing.assert_allclose(turned.R_cam_head, rotation, atol=1e-9)
    assert turned.notes == (f"the face was found after turning the photo by {degrees} degrees",)


def test_no_face(detector: LandmarkDetector, as_photo: AsPhoto) -> None:
    ramp = np.tile(np.linspace(0, 255, 400).astype(np.uint8)[:, None, None], (1, 300, 3))
    with pytest.raises(EstimationError, match=r"^wall\.png: no face found; one must look within"):
        detector.detect(as_photo(ramp, "wall.png"))


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (2, 3)])
def test_a_picture_of_hardly_any_pixels(
    detector: LandmarkDetector, as_photo: AsPhoto, size: tuple[int, int]
) -> None:
    with pytest.raises(EstimationError, match=r"^dot\.png: no face found"):
        detector.detect(as_photo(np.full((*size, 3), 90, np.uint8), "dot.png"))


def test_several_faces(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    both = np.zeros((800, 1050, 3), np.uint8)
    both[:, 450:] = faces["left"]
    both[100:700, :450] = resized(faces["right"], 450)
    photo = as_photo(both)
    largest = detector.detect(photo)
    assert largest.points[NOSE_TIP, 0] > 450
    assert largest.notes == ("2 faces: number 2 from the left, the largest, is used",)
    first = detector.detect(photo, face=1)
    assert first.points[NOSE_TIP, 0] < 450
    assert not first.notes
    np.testing.assert_array_equal(detector.detect(photo, face=2).points, largest.points)
    with pytest.raises(InputError, match=r"face: expected 1 to 2, the faces in face\.png, got 3"):
        detector.detect(photo, face=3)
    with pytest.raises(InputError, match="face: expected a number from 1 on, got 0"):
        detector.detect(photo, face=0)


def test_small_faces(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    small = detector.detect(as_photo(resized(faces["right"], 150)))
    assert "the face is small" in small.notes[0]
    with pytest.raises(
        EstimationError, match=r"face\.png: the face is too small, 1\d px between the eyes; 20"
    ):
        detector.detect(as_photo(resized(faces["right"], 54)))


def test_faces_of_a_turned_photo_are_counted_as_it_stands(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    both = np.zeros((800, 1050, 3), np.uint8)
    both[:, 450:] = faces["left"]
    both[100:700, :450] = resized(faces["right"], 450)
    photo = as_photo(np.rot90(both, 2))
    largest = detector.detect(photo)
    assert largest.points[NOSE_TIP, 0] < 600
    assert largest.notes[0] == "2 faces: number 1 from the left, the largest, is used"
    assert detector.detect(photo, face=2).points[NOSE_TIP, 0] > 600


def test_the_smaller_of_two_near_faces_stays_itself(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto
) -> None:
    both = np.zeros((800, 760, 3), np.uint8)
    both[:, 160:] = faces["left"]
    both[100:380, :210] = resized(faces["right"], 210)
    found = detector.detect(as_photo(both), face=1)
    alone = detector.detect(as_photo(resized(faces["right"], 210)))
    assert shift(found, alone.points + np.array([0, 100])) < 0.03


@pytest.mark.parametrize("edge", ["left", "top", "right", "bottom"])
def test_what_lies_outside_of_the_photo_has_no_confidence(
    detector: LandmarkDetector, faces: dict[str, Array], as_photo: AsPhoto, edge: str
) -> None:
    whole = detector.detect(as_photo(faces["right"]))
    assert not whole.notes
    low, high = whole.points.min(axis=0).astype(int), whole.points.max(axis=0).astype(int)
    quarter = (high - low) // 4
    left, top, right, bottom = 0, 0, *faces["right"].shape[1::-1]
    match edge:
        case "left":
            left = low[0] + quarter[0]
        case "top":
            top = low[1] + quarter[1]
        case "right":
            right = high[0] - quarter[0]
        case _:
            bottom = high[1] - quarter[1]
    cut = detector.detect(as_photo(faces["right"][top:bottom, left:right]))
    outside = ((cut.points < 0) | (cut.points > [right - left, bottom - top])).any(axis=1)
    assert 20 < outside.sum() < 240
    assert (cut.confidence[outside] == 0).all()
    assert (cut.confidence[~outside] > 0).sum() > 150
    assert cut.notes == (
        f"the edge cuts the face, {outside.sum()} of its 478 points lie outside of the picture: "
        "they are a guess",
    )
