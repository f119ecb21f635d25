from __future__ import annotations

import numpy as np
import pytest

from clips import clip, scored
from mien.capture.video.frame_selection import choose_frames, expression_distance, sharp_rows


def test_poses_spread_from_the_frontal_one() -> None:
    scores = clip([-30, -29, -10, 1, 5, 20, 40])
    assert choose_frames(scores, 1).tolist() == [3]
    assert choose_frames(scores, 2).tolist() == [3, 6]
    assert choose_frames(scores, 3).tolist() == [0, 3, 6]
    assert choose_frames(scores, 4).tolist() == [0, 3, 5, 6]


def test_similar_poses_are_selected_once() -> None:
    assert len(choose_frames(clip([0, 1, 2, 20, 21]), 7)) == 2


def test_the_sharpest_frame_of_a_pose() -> None:
    scores = clip([0, 0.5, 1, 25, 25.5, 26], sharpness=[0.8, 1.0, 0.7, 0.9, 0.8, 1.2])
    assert choose_frames(scores, 7).tolist() == [1, 5]


def test_blurred_frames_are_never_taken() -> None:
    assert choose_frames(clip([0, 0, 0, 40], sharpness=[1, 1, 1, 0.2]), 7).tolist() == [0]


def test_sharp_is_what_is_not_half_as_sharp_as_the_others() -> None:
    scores = clip([0] * 5, sharpness=[1.0, 0.49, 0.51, 1.2, 1.0])
    assert sharp_rows(scores, np.arange(5)).tolist() == [0, 2, 3, 4]
    assert sharp_rows(scores, np.array([1, 2])).tolist() == [1, 2], "beside each other only"
    assert sharp_rows(scores, np.array([], int)).tolist() == []


def test_another_expression_is_never_taken() -> None:
    smiles = [scored(mouthSmileLeft=score) for score in (0.1, 0.0, 0.1, 0.9)]
    scores = clip([0, 10, 20, 40], scores=smiles)
    assert choose_frames(scores, 7).tolist() == [0, 1, 2]


def test_an_open_mouth_is_not_at_rest_even_where_it_is_what_the_clip_shows_most() -> None:
    talking = [0.12, 0.15, 0.1, 0.12, 0.0, 0.0]
    scores = clip([0, 10, 20, -20, 5, 30], lip_gap=talking)
    assert choose_frames(scores, 7).tolist() == [4, 5]


def test_brows_at_rest_are_where_they_are_most_of_the_time() -> None:
    usual, raised = scored(browInnerUp=0.5), scored(browInnerUp=0.0)
    scores = clip([0, 10, 20, 30], scores=[raised, usual, usual, usual])
    assert choose_frames(scores, 7).tolist() == [1, 2, 3]


def test_a_head_that_hardly_turns_gives_the_sharpest_frame_at_rest() -> None:
    smiles = [scored(mouthSmile=score) for score in (0.2, 0.05, 0.0, 0.2)]
    at_rest = clip([0, 3, 9, 6], sharpness=[1.0, 0.8, 0.9, 1.0], scores=smiles)
    assert choose_frames(at_rest, 7).tolist() == [2]
    at_rest.sharpness[1] = 0.95
    assert choose_frames(at_rest, 7).tolist() == [1]
    assert len(choose_frames(clip([0, 3, 11, 6], scores=smiles), 7)) > 1


def test_a_head_that_nods_turns() -> None:
    scores = clip([0, 0, 0])
    scores.pose[:, 1] = np.radians([-8, 0, 8])
    assert choose_frames(scores, 7).tolist() == [0, 1, 2]


def test_past_the_detectors_reach() -> None:
    assert choose_frames(clip([0, 70]), 7).tolist() == [0]
    assert choose_frames(clip([55, 70]), 7).tolist() == [0, 1], "there is nothing else"


@pytest.mark.parametrize("count", [1, 7])
def test_a_single_frame(count: int) -> None:
    assert choose_frames(clip([12.0]), count).tolist() == [0]


def test_distance_from_one_expression() -> None:
    blendshapes = np.stack([scored(), scored(mouthSmile=0.6), scored(mouthSmile=0.6, jawOpen=0.8)])
    smile = 0.6 * np.sqrt(2)
    np.testing.assert_allclose(
        expression_distance(blendshapes, 0), [0, smile, np.hypot(smile, 0.8)]
    )
    np.testing.assert_allclose(expression_distance(blendshapes, 1), [smile, 0, 0.8])


def test_gaze_is_no_expression() -> None:
    blendshapes = np.stack([scored(), scored(eyeLookInLeft=1.0), scored(_neutral=1.0)])
    np.testing.assert_array_equal(expression_distance(blendshapes, 0), 0)
