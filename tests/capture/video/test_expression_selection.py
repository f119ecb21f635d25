from __future__ import annotations

import numpy as np
import pytest

from clips import clip, scored
from mien.arrays import Array
from mien.capture.video.expression_selection import (
    MAX_EXPRESSIONS,
    MIN_DISTANCE,
    choose_expressions,
    name_expressions,
)
from mien.capture.video.frame_selection import expression_distance

REST, SMILE = scored(), scored(mouthSmile=0.9)
SURPRISE, SQUINT = scored(jawOpen=0.8, browInnerUp=0.7), scored(eyeSquint=0.5)


def test_the_farthest_comes_first() -> None:
    scores = clip([0] * 4, scores=[REST, SQUINT, SURPRISE, SMILE])
    assert expression_distance(scores.blendshapes, 0).argsort().tolist() == [0, 1, 2, 3]
    # SQUINT is farther from rest than from nothing else that is chosen.
    assert choose_expressions(scores, 0).tolist() == [3, 2, 1]


def test_each_is_the_farthest_from_all_before(rng: np.random.Generator) -> None:
    scores = clip([0] * 60, scores=list(rng.uniform(0, 1, size=(60, 52)) * (rng.random(52) < 0.3)))
    chosen = choose_expressions(scores, 0)
    assert 1 < len(chosen) <= MAX_EXPRESSIONS
    distance = expression_distance(scores.blendshapes, 0)
    for row in chosen:
        assert row == distance.argmax(), "frames that differ so much have no like ones"
        assert distance[row] >= MIN_DISTANCE
        distance = np.minimum(distance, expression_distance(scores.blendshapes, row))


@pytest.mark.parametrize(
    ("score", "chosen"), [(MIN_DISTANCE - 0.01, []), (MIN_DISTANCE + 0.01, [1])]
)
def test_what_differs_too_little_is_no_expression(score: float, chosen: list[int]) -> None:
    scores = clip([0, 0], scores=[REST, scored(jawOpen=score)])
    assert choose_expressions(scores, 0).tolist() == chosen


def test_the_face_at_rest_is_no_expression() -> None:
    assert choose_expressions(clip([0] * 5), 2).tolist() == []


def test_the_sharpest_of_like_frames() -> None:
    smiles = [scored(mouthSmile=score) for score in (0.9, 0.85, 0.8, 0.6)]
    scores = clip([0] * 5, scores=[REST, *smiles], sharpness=[1.0, 0.8, 1.1, 1.0, 2.0])
    assert choose_expressions(scores, 0).tolist() == [2], "the weaker smile is another frame's"


def test_like_frames_are_not_taken_again_when_the_sharpest_was_a_weaker_one() -> None:
    """The frame that was sought counts as shown, too."""
    smiles = [scored(jawOpen=score) for score in (0.62, 0.85, 0.99)]
    scores = clip([0] * 4, scores=[REST, *smiles], sharpness=[1.0, 1.0, 1.2, 1.0])
    assert choose_expressions(scores, 0).tolist() == [2]


@pytest.mark.parametrize(("count", "chosen"), [(0, []), (1, [3]), (2, [3, 2]), (9, [3, 2, 1])])
def test_no_more_than_asked_for(count: int, chosen: list[int]) -> None:
    scores = clip([0] * 4, scores=[REST, SQUINT, SURPRISE, SMILE])
    assert choose_expressions(scores, 0, count).tolist() == chosen


def test_as_many_as_differ_up_to_a_number_when_none_is_asked_for() -> None:
    scores = clip([0] * 21, scores=[REST, *np.eye(52)[25:45]])
    assert len(choose_expressions(scores, 0)) == MAX_EXPRESSIONS
    assert len(choose_expressions(scores, 0, 12)) == 12


def test_blurred_and_turned_away_frames_are_never_taken() -> None:
    scores = clip(
        [0, 0, 0, 26, -30, 0, 10],
        scores=[REST, REST, SMILE, SURPRISE, SURPRISE, scored(jawOpen=1.0), SQUINT],
        sharpness=[1, 1, 1, 1, 1, 0.3, 1],
    )
    assert choose_expressions(scores, 0).tolist() == [2, 6]
    nobody = clip([40, 50], scores=[REST, SMILE])
    assert choose_expressions(nobody, 0).tolist() == []


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (scored(mouthSmile=0.7, jawOpen=0.3), "smile"),
        (scored(jawOpen=0.8, mouthSmileLeft=0.3), "open_mouth"),
        (scored(eyeBlink=0.9), "eyes_closed"),
        (scored(jawLeft=0.5), "jaw_aside"),
        (scored(mouthRight=0.5), "mouth_aside"),
        (scored(browOuterUpLeft=0.6), "brows_up"),
        (scored(jawOpen=0.19), "expression"),
        (scored(eyeLookUp=0.9), "expression"),
    ],
)
def test_an_expression_is_called_by_what_changes_most(change: Array, name: str) -> None:
    assert name_expressions(change[None], REST) == (name,)


def test_what_falls_names_only_brows() -> None:
    """Brows that sink show in what the detector had of raised ones."""
    rest = scored(browInnerUp=0.6, mouthSmile=0.5)
    assert name_expressions(scored(mouthSmile=0.5)[None], rest) == ("brows_down",)
    assert name_expressions(scored(browInnerUp=0.6)[None], rest) == ("expression",)


def test_names_are_taken_once() -> None:
    smiles = [scored(mouthSmile=0.9), scored(mouthSmile=0.9, jawOpen=0.5)]
    smiles += [scored(mouthSmile=0.9), scored(mouthSmile=0.9)]
    names = name_expressions(np.stack(smiles), REST)
    assert names == ("smile", "smile-open_mouth", "smile-2", "smile-3")


def test_any_number_of_like_expressions_has_unique_names() -> None:
    for change in (REST, SMILE, SURPRISE, scored(mouthSmile=0.9, jawOpen=0.5, eyeBlink=0.4)):
        names = name_expressions(np.tile(change, (12, 1)), REST)
        assert len(set(names)) == 12
