"""Hands before mouths, painted; and real ones."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.synthesis.examples.mouth_occlusion import LipContrast

SKIN, LIPS, HAND = (200, 160, 140), (150, 80, 80), (205, 162, 138)


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


def face(layout, *, hand=False):
    """A flat face with red lips, a hand over one corner of them; any landmarks that give it."""
    points = 90 + 120 * layout.template
    picture = np.full((240, 200, 3), SKIN, np.uint8)
    rows = [i for i, name in enumerate(layout.names) if "lip" in name and "skin" not in name]
    rows += [layout.index(f"{side}_mouth_corner") for side in ("right", "left")]
    outline = cv2.convexHull(points[rows].astype(np.float32))
    cv2.fillConvexPoly(picture, np.rint(outline).astype(np.int32), LIPS)
    if hand:
        corner = np.rint(points[layout.index("right_mouth_corner")]).astype(int)
        cv2.circle(picture, corner.tolist(), 40, HAND, -1)
    landmarks = np.linalg.lstsq(layout.landmark_weights, points, rcond=None)[0]
    return picture, landmarks


def measured(layout, hands):
    lips = LipContrast(layout)
    for hand in hands:
        lips(*face(layout, hand=hand))
    return lips


def test_a_hand_before_the_mouth(layout):
    hands = np.arange(20) >= 16
    np.testing.assert_array_equal(measured(layout, hands).occluded(), hands)


def test_frames_near_in_time_and_in_gaps_are_occluded_too(layout):
    hands = np.isin(np.arange(40), (10, 24))
    occluded = measured(layout, hands).occluded(np.arange(40) / 10)
    # Half a second before and after, and all of the 1.4 s between both.
    np.testing.assert_array_equal(np.flatnonzero(occluded), np.arange(5, 30))


def test_few_pictures_are_never_occluded(layout):
    assert not measured(layout, [True, False, False]).occluded().any()


def test_faces_outside_of_the_picture_are_not_occluded(layout):
    lips = measured(layout, [False] * 15)
    picture, landmarks = face(layout)
    lips(picture, landmarks + 1000)
    assert not lips.occluded().any()


def test_another_exposure_is_no_occlusion(layout):
    lips = measured(layout, [False] * 15)
    picture, landmarks = face(layout)
    lips((picture * 0.5).astype(np.uint8), landmarks)
    assert not lips.occluded().any()
