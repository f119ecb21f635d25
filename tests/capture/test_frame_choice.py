from __future__ import annotations

import numpy as np

from mien.capture.frame_choice import FrameScores, choose_frames, expression_distance
from mien.capture.mediapipe_face import BLENDSHAPE_NAMES


def clip(
    yaw: list[float], sharpness: list[float] | None = None, smile: list[float] | None = None
) -> FrameScores:
    """Frames 0, 10, 20, ... with yaw in degrees."""
    blendshapes = np.zeros((len(yaw), 52))
    blendshapes[:, BLENDSHAPE_NAMES.index("mouthSmileLeft")] = smile or 0.0
    return FrameScores(
        10 * np.arange(len(yaw)),
        np.array(sharpness or [1.0] * len(yaw)),
        np.column_stack([np.radians(yaw), np.zeros(len(yaw))]),
        blendshapes,
    )


def test_poses_spread_from_the_frontal_one() -> None:
    scores = clip([-30, -29, -10, 1, 5, 20, 40])
    assert choose_frames(scores, 1).tolist() == [3]
    assert choose_frames(scores, 2).tolist() == [3, 6]
    assert choose_frames(scores, 3).tolist() == [0, 3, 6]
    assert choose_frames(scores, 4).tolist() == [0, 3, 5, 6]


def test_like_poses_are_taken_once() -> None:
    assert len(choose_frames(clip([0, 1, 2, 20, 21]), 7)) == 2


def test_the_sharpest_frame_of_a_pose() -> None:
    scores = clip([0, 0.5, 1, 25, 25.5, 26], [0.8, 1.0, 0.7, 0.9, 0.8, 1.2])
    assert choose_frames(scores, 7).tolist() == [1, 5]


def test_blurred_frames_are_never_taken() -> None:
    assert choose_frames(clip([0, 0, 0, 40], [1, 1, 1, 0.2]), 7).tolist() == [0]


def test_another_expression_is_never_taken() -> None:
    scores = clip([0, 10, 20, 40], smile=[0.1, 0.0, 0.1, 0.9])
    assert choose_frames(scores, 7).tolist() == [0, 1, 2]
    np.testing.assert_allclose(expression_distance(scores.blendshapes)[3], [0.8], atol=0.11)


def test_gaze_is_no_expression() -> None:
    blendshapes = np.zeros((3, 52))
    blendshapes[1, BLENDSHAPE_NAMES.index("eyeLookInLeft")] = 1.0
    np.testing.assert_array_equal(expression_distance(blendshapes), 0)


def test_past_the_detectors_reach() -> None:
    assert choose_frames(clip([0, 70]), 7).tolist() == [0]
    assert choose_frames(clip([65, 70]), 7).tolist() == [0, 1]


def test_a_single_frame() -> None:
    assert choose_frames(clip([12.0]), 7).tolist() == [0]
