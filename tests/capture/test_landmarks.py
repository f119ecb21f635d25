from __future__ import annotations

import numpy as np
import pytest

from mien.capture.landmarks import Landmarks, facing_confidence
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
