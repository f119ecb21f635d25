"""Completed points and pictures of a person whose expressions are known by formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hull import hull_distances
from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.errors import EstimationError, InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.synthesizer import Synthesis, SynthesisOptions, Synthesizer

WIDTH, HEIGHT = 160, 200
MOVED = PlanarSimilarity(np.array(1.1), np.array(0.15), np.array([-20.0, 4.0]))


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


@pytest.fixture(scope="module")
def person(layout):
    """Six examples; four modes of which every expression is a sum."""
    rng = np.random.default_rng(5)
    base = layout.template - layout.template.mean(0)
    neutral = base * 0.6 * WIDTH + [WIDTH / 2, HEIGHT / 2]
    modes = np.stack([_smooth_mode(rng, base) for _ in range(4)])
    places = [neutral, *(neutral + np.tensordot(row, modes, 1) for row in rng.normal(0, 1, (5, 4)))]
    expressions = neutral + np.tensordot(rng.normal(0, 1, (60, 4)), modes, 1)
    photos = [rng.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8) for _ in places]
    pairs = enumerate(zip(photos, places, strict=True))
    examples = tuple(Example(f"e{i}", photo, points, f"{i}.png") for i, (photo, points) in pairs)
    subregions = default_subregions(layout, places[1], (WIDTH, HEIGHT))
    example_set = ExampleSet(layout, examples, 1, expressions, subregions)
    return replace(example_set, statistics=example_set.geometry(expressions)), modes


def _smooth_mode(rng, base):
    """A displacement of all points that varies smoothly over the face, some px large."""
    phase, wave = rng.uniform(0, 6, 2), rng.normal(0, 4, (2, 2))
    return 1.5 * np.stack([np.sin(base @ wave[i] + phase[i]) for i in (0, 1)], axis=-1)


def new_expression(person):
    example_set, modes = person
    return example_set.neutral.points + np.tensordot([0.6, -0.8, 0.3, 0.5], modes, 1)


@pytest.mark.parametrize("count", [12, 40])
def test_points_are_completed_whatever_the_head_motion(person, count):
    example_set, _ = person
    truth = MOVED(new_expression(person))
    known = np.random.default_rng(count).permutation(len(truth))[:count]
    completed = Synthesizer(example_set).complete(known, truth[known])
    np.testing.assert_allclose(completed, truth, atol=0.3)
    np.testing.assert_array_equal(completed[known], truth[known])


def test_the_printed_propagation_completes_too(person):
    example_set, _ = person
    truth = new_expression(person)
    known = np.arange(0, len(truth), 6)
    synthesizer = Synthesizer(example_set, SynthesisOptions(propagation="printed"))
    completed = synthesizer.complete(known, truth[known])
    moved = np.linalg.norm(truth - example_set.neutral.points, axis=1).mean()
    assert np.linalg.norm(completed - truth, axis=1).mean() < 0.2 * moved


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_points_move_a_face_whose_head_is_still(person, count):
    example_set, _ = person
    neutral = example_set.neutral.points
    known = np.array([example_set.layout.index("right_mouth_corner"), 3])[:count]
    completed = Synthesizer(example_set).complete(known, neutral[known] + 2)
    np.testing.assert_array_equal(completed[known], neutral[known] + 2)
    assert np.linalg.norm(completed - neutral, axis=1).mean() > 0.5


def test_three_points_that_shift_are_a_head_that_moved_or_an_expression(person):
    """Estimated head motion is no expression: the same wherever the head is. A still one is not."""
    example_set, _ = person
    neutral = example_set.neutral.points
    names = ("right_mouth_corner", "left_mouth_corner", "menton")
    known = np.array([example_set.layout.index(name) for name in names])
    synthesizer = Synthesizer(example_set)

    def shifted(by, head):
        return synthesizer.complete(known, neutral[known] + by, head=head)

    moved = shifted([0, -3], "estimated") - shifted([0, 0], "estimated")
    np.testing.assert_allclose(moved, np.broadcast_to([0, -3], moved.shape), atol=1e-6)
    still = shifted([0, -3], "still") - shifted([0, 0], "still")
    assert np.linalg.norm(still - [0, -3], axis=1).mean() > 1
    np.testing.assert_allclose(still[known], moved[known], atol=1e-6)


def test_all_points_stay_where_they_are(person):
    truth = MOVED(new_expression(person))
    completed = Synthesizer(person[0]).complete(np.arange(len(truth)), truth)
    np.testing.assert_array_equal(completed, truth)


def test_one_picture_is_too_few_to_complete_points(person):
    """All points need none; from a few, nothing can be learned."""
    truth = new_expression(person)
    synthesizer = Synthesizer(replace(person[0], statistics=person[0].statistics[:1]))
    completed = synthesizer.complete(np.arange(len(truth)), truth)
    np.testing.assert_array_equal(completed, truth)
    with pytest.raises(InputError, match=r"examples: expected points of 2 .*got 1"):
        synthesizer.complete(np.arange(5), truth[:5])


def test_a_set_of_points_is_learned_once(person, monkeypatch):
    from mien.synthesis import synthesizer as module

    learned = []
    original = module.ConditionalGaussian
    monkeypatch.setattr(
        module,
        "ConditionalGaussian",
        lambda *a, **options: learned.append(1) or original(*a, **options),
    )
    synthesizer = Synthesizer(person[0])
    points = new_expression(person)
    for known in ([0, 9, 30, 60], [60, 0, 30, 9], [1, 9, 30, 60], [0, 9, 30, 60]):
        synthesizer.complete(np.array(known), points[known])
    assert len(learned) == 2


def test_the_order_of_points_does_not_matter(person):
    points = new_expression(person)
    known = np.array([90, 4, 33, 71, 12])
    synthesizer = Synthesizer(person[0])
    completed = synthesizer.complete(known, points[known])
    again = synthesizer.complete(known[::-1], points[known[::-1]])
    np.testing.assert_array_equal(completed, again)


def test_points_may_be_named(person):
    synthesizer, points = Synthesizer(person[0]), new_expression(person)
    names = ["left_mouth_corner", "menton", "nose_tip"]
    known = np.array([person[0].layout.index(name) for name in names])
    expected = synthesizer.complete(known, points[known])
    by_name = dict(zip(names, points[known].tolist(), strict=True))
    np.testing.assert_array_equal(synthesizer.complete(by_name), expected)
    np.testing.assert_array_equal(synthesizer.complete(names, points[known]), expected)


def test_bad_names_of_points(person):
    synthesizer = Synthesizer(person[0])
    with pytest.raises(InputError, match="feature point: expected a point of zhang134"):
        synthesizer.complete({"left_mouth_korner": (1.0, 2.0)})
    with pytest.raises(InputError, match="known: expected indices of at least one point"):
        synthesizer.complete({})
    with pytest.raises(InputError, match="positions: expected one for each of the points"):
        synthesizer.complete(["menton"])
    with pytest.raises(InputError, match="positions: expected none beside positions by name"):
        synthesizer.complete({"menton": (1.0, 2.0)}, [(1.0, 2.0)])
    with pytest.raises(InputError, match=r"displacements: expected shape \(1, 2\)"):
        synthesizer.complete({"menton": (1.0, 2.0, 3.0)})


@pytest.mark.parametrize("index", range(6))
def test_an_examples_own_points_are_made_from_it(person, index):
    example_set, _ = person
    made = Synthesizer(example_set).synthesize(example_set.examples[index].points)
    assert isinstance(made, Synthesis)
    np.testing.assert_allclose(made.coefficients[:, index], 1, atol=0.01)
    assert made.hull_px.max() < 0.1
    assert made.image.shape == (HEIGHT, WIDTH, 3)


def test_the_distance_from_the_hull_is_given_by_subregion(person):
    example_set, _ = person
    points = example_set.neutral.points.copy()
    names = example_set.subregions.names
    alone = np.flatnonzero([name.startswith("nose") for name in example_set.layout.names])
    points[alone] += [0, 9]
    made = Synthesizer(example_set, SynthesisOptions.paper()).synthesize(points)
    assert names[made.hull_px.argmax()] == "nose"
    np.testing.assert_allclose(made.hull_px, hull_distances(example_set, points), atol=1e-3)


def test_head_motion_is_no_expression(person):
    synthesizer = Synthesizer(person[0])
    points = new_expression(person)
    still, moved = synthesizer.synthesize(points), synthesizer.synthesize(MOVED(points))
    np.testing.assert_allclose(still.coefficients, moved.coefficients, atol=1e-6)
    np.testing.assert_allclose(still.hull_px, moved.hull_px, atol=1e-6)


def test_a_moved_head_is_drawn_where_it_is(person):
    """The picture of a shifted head is the shifted picture of the still one."""
    synthesizer = Synthesizer(person[0])
    points = new_expression(person)
    still = synthesizer.synthesize(points).image
    shift = PlanarSimilarity(np.array(1.0), np.array(0.0), np.array([7.0, 4.0]))
    moved = synthesizer.synthesize(shift(points), motion=shift, size=(WIDTH + 30, HEIGHT)).image
    assert moved.shape == (HEIGHT, WIDTH + 30, 3)
    difference = moved[4:, 7 : WIDTH + 7].astype(int) - still[:-4]
    assert np.abs(difference).mean() < 0.1
    np.testing.assert_allclose(synthesizer.head_motion(shift(points)).a, 1, atol=0.1)


def test_the_picture_is_drawn_into_memory_that_is_given(person):
    out = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    made = Synthesizer(person[0]).synthesize(new_expression(person), out=out)
    assert made.image is out


def test_the_paper_has_none_of_the_additions():
    paper = SynthesisOptions.paper()
    assert (paper.distance_penalty, paper.slack, paper.tied) == (0, 0, ())
    assert paper.propagation == "printed"


def test_bad_options_and_points(person):
    with pytest.raises(InputError, match="propagation: expected closed-form or printed, got pca"):
        SynthesisOptions(propagation="pca")
    with pytest.raises(InputError, match=r"slack: expected a number of 0 or more, got -0\.1"):
        SynthesisOptions(slack=-0.1)
    with pytest.raises(InputError, match=r"slack: expected a share, from 0 to 1, got 1e\+300"):
        SynthesisOptions(slack=1e300)
    with pytest.raises(InputError, match="distance_penalty: expected finite numbers, got nan"):
        SynthesisOptions(distance_penalty=np.nan)
    synthesizer = Synthesizer(person[0])
    with pytest.raises(InputError, match="head: expected estimated or still, got moved"):
        synthesizer.complete(np.array([3]), np.zeros((1, 2)), head="moved")
    with pytest.raises(InputError, match="known: expected each point once, got point 3 twice"):
        synthesizer.complete(np.array([3, 3, 4]), np.zeros((3, 2)))
    with pytest.raises(EstimationError, match="share a place"):
        synthesizer.complete(np.array([3, 4, 5]), np.ones((3, 2)))
