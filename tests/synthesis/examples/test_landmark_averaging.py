"""Feature points averaged over several detections in a picture."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import mien.assets
from mien.assets.feature_points import load_feature_layout
from mien.capture.faces.detector import LandmarkDetector
from mien.errors import InputError
from mien.synthesis.examples.landmark_averaging import averaged_points

LAYOUT = load_feature_layout()
JAMES = Path(mien.assets.__file__).parent / "data" / "james" / "photo_left.png"


@pytest.fixture(scope="module")
def photo():
    return np.asarray(Image.open(JAMES).convert("RGB").resize((600, 800)))


@pytest.fixture(scope="module")
def detections(photo):
    """Landmarks of one detection, and averaged points, of the photo and of its mirror image."""
    mirrored = np.ascontiguousarray(photo[:, ::-1])
    with LandmarkDetector() as detector:
        landmarks = [detector.detect_fast(image).points[:, :2] for image in (photo, mirrored)]
        points = [
            averaged_points(LAYOUT, detector, image, found)
            for image, found in zip((photo, mirrored), landmarks, strict=True)
        ]
    return landmarks, points


def test_averaged_points_are_near_those_of_a_single_detection(detections):
    (landmarks, _), (points, _) = detections
    once = LAYOUT.from_landmarks(landmarks)
    width = np.ptp(once[:, 0])
    assert np.linalg.norm(points - once, axis=1).mean() < 0.02 * width
    assert np.linalg.norm(points.mean(0) - once.mean(0)) < 0.01 * width


def test_the_mirrored_picture_has_mirrored_points(detections, photo):
    """Except at the edges of the crops, both pictures give the same crops."""
    landmarks, (points, mirrored) = detections

    def difference(one, other):
        back = other[LAYOUT.mirror] * [-1, 1] + [photo.shape[1], 0]
        return np.linalg.norm(one - back, axis=1).mean()

    single = difference(*(LAYOUT.from_landmarks(found) for found in landmarks))
    assert difference(points, mirrored) < 0.7 * single


def _detector(face):
    return SimpleNamespace(detect_fast=lambda crop: face)


def test_without_another_detection_the_points_stay(detections, photo):
    landmarks = detections[0][0]
    points = averaged_points(LAYOUT, _detector(None), photo, landmarks)
    np.testing.assert_array_equal(points, LAYOUT.from_landmarks(landmarks))


def test_points_of_a_large_picture_are_not_shifted(detections):
    """Reduced, it is 429.4 px wide, for which 429 stand; three marks show where a crop is."""
    marks = np.array([[300.5, 1000.5], [750.5, 1100.5], [450.5, 1550.5]])
    picture = np.zeros((1777, 1000, 3), np.uint8)
    for channel, (x, y) in enumerate(marks.astype(int)):
        picture[y - 10 : y + 11, x - 10 : x + 11, channel] = 255
    face = detections[0][0]
    landmarks = (face - face.min(axis=0)) * (400 / np.ptp(face[:, 0])) + [300, 1000]
    crops = []

    def detect(crop):
        positions = np.indices(crop.shape[:2])[::-1] + 0.5
        weights = crop.astype(float)
        if not (sums := weights.sum(axis=(0, 1))).all():
            return None
        found = np.einsum("dyx,yxc->cd", positions, weights) / sums[:, None]
        crops.append(crop)
        to_crop = np.linalg.solve(np.column_stack([marks, np.ones(3)]), found)
        return SimpleNamespace(points=np.column_stack([landmarks, np.ones(478)]) @ to_crop)

    points = averaged_points(LAYOUT, SimpleNamespace(detect_fast=detect), picture, landmarks)
    assert len(crops) == 6
    np.testing.assert_allclose(points, LAYOUT.from_landmarks(landmarks), atol=0.1)


def test_a_detection_of_another_face_is_left_out(detections, photo):
    landmarks = detections[0][0]
    other = SimpleNamespace(points=np.zeros((478, 3)))
    points = averaged_points(LAYOUT, _detector(other), photo, landmarks)
    np.testing.assert_array_equal(points, LAYOUT.from_landmarks(landmarks))


def test_bad_landmarks(photo):
    with pytest.raises(InputError, match="landmarks"):
        averaged_points(LAYOUT, _detector(None), photo, np.zeros((468, 2)))


def test_landmarks_in_one_place(photo):
    with pytest.raises(InputError, match="landmarks: expected a face with a width"):
        averaged_points(LAYOUT, _detector(None), photo, np.ones((478, 2)))
