"""The choice of examples: what it covers, what it leaves out, and its reasons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.errors import InputError
from mien.synthesis.examples.selection import ExampleCandidates, choose_examples

BROW, MOUTH = np.arange(4), np.arange(4, 10)
REGIONS = [("brow", BROW), ("mouth", MOUTH)]


@pytest.fixture
def candidates(rng):
    """Ten frames each of a face at rest, of raised brows and of an open mouth."""
    at_rest = 100 + 20 * rng.normal(size=(10, 2))
    geometries = np.tile(at_rest, (30, 1, 1)) + 0.01 * rng.normal(size=(30, 10, 2))
    geometries[10:20, BROW] -= [0, 1]
    geometries[20:, MOUTH[3:]] += [0, 30]
    return ExampleCandidates(geometries, np.ones(30), np.zeros((30, 2)))


def test_three_examples_cover_three_expressions(candidates):
    choice = choose_examples(candidates, REGIONS, 4, count=3)
    assert choice.rows[0] == 4
    assert sorted(row // 10 for row in choice.rows) == [0, 1, 2]


def test_small_movements_count_as_much_as_large_ones(candidates):
    """Brows move by a thirtieth of the mouth here."""
    chosen = set(choose_examples(candidates, REGIONS, 4, count=3).rows[1:] // 10)
    assert chosen == {1, 2}


def test_every_candidate_has_its_reason(candidates):
    choice = choose_examples(candidates, REGIONS, 4, count=3)
    assert choice.reasons[4] == "neutral"
    for row, region in zip(sorted(choice.rows[1:]), ("brow", "mouth"), strict=True):
        assert choice.reasons[row].startswith("chosen as number")
        assert choice.reasons[row].endswith(f"for the {region}")
    others = set(range(30)) - set(choice.rows)
    for row in others:
        kind, _, like = choice.reasons[row].rpartition(" candidate ")
        assert kind == "different, but beyond the count; nearest is"
        assert int(like) // 10 == row // 10


def test_expressions_that_differ_by_less_than_the_least_distance_are_alike(candidates):
    """Noise is 0.01 px, brows move by 1 px and the mouth by 30."""
    choice = choose_examples(candidates, REGIONS, 4, min_distance=0.1)
    assert sorted(row // 10 for row in choice.rows) == [0, 1, 2]
    assert choice.reasons[3] == "like candidate 4"
    choice = choose_examples(candidates, REGIONS, 4, min_distance=2.0)
    assert sorted(row // 10 for row in choice.rows) == [0, 2]
    assert choice.reasons[12] == "like candidate 4"


def test_reasons_name_the_pictures(candidates):
    named = replace(candidates, names=tuple(f"{row}.jpg" for row in range(30)))
    assert choose_examples(named, REGIONS, 4, min_distance=0.1).reasons[3] == "like 4.jpg"


def test_required_ones_come_first_whatever_they_are_like(candidates):
    sharpness = np.ones(30)
    sharpness[7] = 0.1
    blurred = replace(candidates, sharpness=sharpness)
    required = {25: "standard", 7: "as asked for"}
    choice = choose_examples(blurred, REGIONS, 4, required=required, count=4, min_distance=0.1)
    assert list(choice.rows[:3]) == [4, 25, 7]
    assert (choice.reasons[25], choice.reasons[7]) == ("standard", "as asked for")
    # The mouth is there already: only the brows are left.
    assert [row // 10 for row in choice.rows[3:]] == [1]
    assert not choice.eligible[7]


def test_excluded_ones_are_no_examples(candidates):
    choice = choose_examples(candidates, REGIONS, 4, exclude=[*range(10, 20), 5], min_distance=0.1)
    assert sorted(row // 10 for row in choice.rows) == [0, 2]
    assert choice.reasons[12] == "excluded"
    assert choice.eligible.sum() == 19


def test_rejected_ones_are_no_examples_and_the_reason_is_the_known_one(candidates):
    rejections = [""] * 10 + ["covered"] * 10 + [""] * 10
    pose = np.zeros((30, 2))
    pose[12] = [1, 0]
    choice = choose_examples(
        replace(candidates, rejections=tuple(rejections), pose=pose), REGIONS, 4, min_distance=0.1
    )
    assert sorted(row // 10 for row in choice.rows) == [0, 2]
    assert choice.reasons[12] == "covered"


def test_blurred_and_turned_ones_are_rejected(candidates):
    sharpness, pose = np.ones(30), np.zeros((30, 2))
    sharpness[10:15] = 0.3
    pose[20:25] = [0, np.radians(-40)]
    candidates = replace(candidates, sharpness=sharpness, pose=pose)
    choice = choose_examples(candidates, REGIONS, 4, count=30)
    assert not set(choice.rows) & {*range(10, 15), *range(20, 25)}
    assert choice.reasons[10] == "blurred, 30% of the usual sharpness"
    assert choice.reasons[20] == "turned away by 40 degrees"


def test_where_nothing_is_sharp_nothing_is_blurred(candidates):
    plain = replace(candidates, sharpness=np.zeros(30))
    assert choose_examples(plain, REGIONS, 4, count=3).eligible.all()


def test_the_turn_is_measured_from_neutral(candidates):
    candidates = replace(candidates, pose=np.tile([0.6, 0.0], (30, 1)))
    assert len(choose_examples(candidates, REGIONS, 4, count=30).rows) == 30


def test_neutral_stays_whatever_it_is_like(candidates):
    sharpness = np.ones(30)
    sharpness[4] = 0.1
    choice = choose_examples(replace(candidates, sharpness=sharpness), REGIONS, 4, count=3)
    assert choice.rows[0] == 4
    assert choice.reasons[4] == "neutral"


def test_what_was_chosen_stays_when_more_are_asked_for(candidates):
    few = choose_examples(candidates, REGIONS, 4, count=5).rows
    many = choose_examples(candidates, REGIONS, 4, count=9).rows
    np.testing.assert_array_equal(many[:5], few)


def test_copies_are_no_examples(candidates):
    geometries = np.repeat(candidates.geometries[[0, 10, 20]], 10, axis=0)
    choice = choose_examples(replace(candidates, geometries=geometries), REGIONS, 4, count=30)
    assert len(choice.rows) == 3


def test_a_face_that_never_moves_is_one_example(candidates):
    still = replace(candidates, geometries=np.tile(candidates.geometries[:1], (30, 1, 1)))
    assert list(choose_examples(still, REGIONS, 2).rows) == [2]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"neutral": 30}, "neutral: expected one of 30 candidates"),
        ({"required": {31: "x"}}, "required: expected one of 30 candidates"),
        ({"exclude": [-1]}, "exclude: expected one of 30 candidates"),
        ({"exclude": [4]}, "exclude: expected others than those that are wanted, got neutral"),
        ({"count": 0}, "count: expected a number above zero"),
        ({"regions": [("ear", np.array([], int))]}, "subregion ear: expected at least one point"),
    ],
)
def test_bad_requests(candidates, change, message):
    request = {"regions": REGIONS, "neutral": 4, "count": 3} | change
    with pytest.raises(InputError, match=message):
        choose_examples(candidates, **request)


def test_measures_of_other_photos(candidates):
    with pytest.raises(InputError, match="sharpness"):
        replace(candidates, sharpness=np.ones(29))
    with pytest.raises(InputError, match="names: expected one for each of 30 candidates, got 2"):
        replace(candidates, names=("a", "b"))
    with pytest.raises(InputError, match="pose"):
        replace(candidates, pose=np.zeros((29, 2)))
