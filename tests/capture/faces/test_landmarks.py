from __future__ import annotations

import numpy as np
import pytest

from mien.capture.faces.landmarks import (
    Landmarks,
    cut_note,
    facing_confidence,
    inside_picture,
    is_cut,
)
from mien.errors import InputError

FRONTAL = np.diag([1.0, -1.0, -1.0])


def turned(yaw: float) -> np.ndarray:
    """R_cam_head of a head turned to its own left by so many degrees."""
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return FRONTAL @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.mark.parametrize("yaw", [0.0, 35.0, -50.0])
def test_confidence_on_half_a_ball_is_the_ramp_of_its_cosine(yaw: float) -> None:
    # Fibonacci's spiral spreads points evenly.
    height = (np.arange(1000) + 0.5) / 1000
    around = np.pi * (1 + np.sqrt(5)) * np.arange(1000)
    radius = np.sqrt(1 - height**2)
    normals = np.column_stack([radius * np.cos(around), radius * np.sin(around), height])
    R_cam_head = turned(yaw)
    confidence = facing_confidence(100 * normals @ R_cam_head.T + [300, 200, 5], R_cam_head)
    facing = -(normals @ R_cam_head.T)[:, 2]
    inner = normals[:, 2] > 0.3
    np.testing.assert_allclose(
        confidence[inner], np.clip((facing - 0.1) / 0.8, 0, 1)[inner], atol=0.05
    )
    assert (confidence[inner & (facing < 0)] == 0).all()


def test_bad_arrays_are_named() -> None:
    good = {
        "points": np.zeros((478, 2)),
        "confidence": np.ones(478),
        "blendshapes": np.zeros(52),
        "R_cam_head": FRONTAL,
    }
    landmarks = Landmarks(**good)
    assert not landmarks.points.flags.writeable
    for name, bad in (
        ("points", np.zeros((477, 2))),
        ("confidence", np.full(478, np.nan)),
        ("R_cam_head", np.eye(3) * 2),
    ):
        with pytest.raises(InputError, match=f"^{name}: expected"):
            Landmarks(**{**good, name: bad})


def test_points_beyond_the_edge_are_not_in_the_picture() -> None:
    points = np.array([[-1.0, 5], [0, 0], [50, 40], [50, 40.5], [51, 20], [20, 30]])
    expected = [False, True, True, False, False, True]
    assert inside_picture(points, (50, 40)).tolist() == expected


def test_a_face_is_cut_from_two_hundredths_of_its_width_beyond_the_edge_on() -> None:
    face = np.array([[0.0, 10], [100, 10], [50, 80]])
    assert not is_cut(face, (100, 80))
    assert not is_cut(face + np.array([1.9, 0]), (100, 80))
    assert is_cut(face + np.array([2.1, 0]), (100, 80))
    assert is_cut(face - np.array([0, 12.1]), (100, 80))
    assert cut_note(face + np.array([1.9, 0]), (100, 80)) == ()
    assert cut_note(face - np.array([0, 12.1]), (100, 80)) == (
        "the edge cuts the face, 2 of its 3 points lie outside of the picture: they are a guess",
    )
