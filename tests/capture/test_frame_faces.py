from __future__ import annotations

import cv2
import numpy as np

from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.frame_faces import FrameFaces


def frame(face: Array, left: int, top: int, height: int = 300) -> Array:
    """A large frame with a small picture of the face in it."""
    pixels = np.full((1080, 1920, 3), 110, np.uint8)
    small = cv2.resize(face, (height * 3 // 4, height), interpolation=cv2.INTER_AREA)
    pixels[top : top + height, left : left + small.shape[1]] = small
    return pixels


def test_a_small_face_is_found_and_followed(
    faces: dict[str, Array], detector: LandmarkDetector
) -> None:
    finder = FrameFaces(detector, 640)
    first = frame(faces["left"], 1300, 500)
    assert not detector.detect_all_fast(cv2.resize(first, (640, 360)))
    (found,) = finder.find(first)
    middle = found.points[:, :2].mean(axis=0)
    assert 1300 < middle[0] < 1525
    assert 500 < middle[1] < 800
    (moved,) = finder.find(frame(faces["left"], 1320, 510))
    np.testing.assert_allclose(
        moved.points[:, :2].mean(axis=0), middle + np.array([20, 10]), atol=4
    )


def test_a_large_face_is_in_the_pixels_of_the_frame(
    faces: dict[str, Array], detector: LandmarkDetector
) -> None:
    (plain,) = detector.detect_all_fast(faces["left"])
    (found,) = FrameFaces(detector, 400).find(faces["left"])
    off = np.linalg.norm((found.points - plain.points)[:, :2], axis=1)
    assert np.median(off) < 3


def test_nobody(detector: LandmarkDetector) -> None:
    finder = FrameFaces(detector, 640)
    for _ in range(10):
        assert finder.find(np.full((300, 400, 3), 99, np.uint8)) == []
