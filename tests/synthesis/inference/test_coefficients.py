"""Shares of examples by subregion ([Zhang 2006] section 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hull import hull_distances
from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import Subregions, default_subregions
from mien.errors import InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.inference.coefficients import (
    BROWS,
    UPPER_FACE,
    coefficients,
    coefficients_from_offsets,
    mixture_distances,
)

PHOTO = np.zeros((30, 20, 3), np.uint8)
MOVED = PlanarSimilarity(np.array(1.2), np.array(0.1), np.array([3.0, 8.0]))


@pytest.fixture(scope="module")
def example_set():
    """Neutral and four expressions of two subregions, free of head motion as they are."""
    rng = np.random.default_rng(3)
    layout = load_feature_layout()
    rest = 100 + 200 * layout.template
    motion = _rigid(rest)
    examples = [Example("neutral", PHOTO, rest, "0.png")]
    for number in range(1, 5):
        change = 4 * rng.normal(size=rest.size)
        change -= motion @ (motion.T @ change)
        examples.append(Example(str(number), PHOTO, rest + change.reshape(-1, 2), f"{number}.png"))
    half = len(rest) // 2
    members = (np.arange(half), np.arange(half, len(rest)))
    subregions = Subregions(("right", "left"), np.full((30, 20, 2), 0.5, np.float32), members)
    return ExampleSet(layout, tuple(examples), 0, rest[None], subregions)


def _rigid(points):
    centred = points - points.mean(axis=0)
    turned = centred[:, ::-1] * [-1, 1]
    ones = np.ones(len(points))
    columns = [np.outer(ones, [1, 0]), np.outer(ones, [0, 1]), centred, turned]
    return np.linalg.qr(np.stack([column.ravel() for column in columns], axis=1))[0]


@pytest.mark.parametrize("row", range(5))
def test_an_examples_own_points_give_it_alone(example_set, row):
    shares = coefficients(example_set, MOVED(example_set.examples[row].points))
    np.testing.assert_allclose(shares, np.tile(np.eye(5)[row], (2, 1)), atol=1e-5)


def test_a_mixture_within_the_hull_is_found(example_set):
    truth = np.array([0.4, 0.3, 0.0, 0.2, 0.1])
    points = np.einsum("m,mnd->nd", truth, example_set.geometries)
    shares = coefficients(example_set, MOVED(points), distance_penalty=0.0)
    np.testing.assert_allclose(shares, np.tile(truth, (2, 1)), atol=1e-4)
    np.testing.assert_allclose(hull_distances(example_set, MOVED(points)), 0, atol=1e-2)


def test_coefficients_sum_to_one(example_set, rng):
    points = example_set.neutral.points + 9 * rng.normal(size=example_set.neutral.points.shape)
    shares = coefficients(example_set, points)
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-9)
    assert shares.min() > -1e-9


def test_a_heavy_penalty_leaves_the_nearest(example_set):
    near, far = example_set.geometries[1], example_set.geometries[3]
    shares = coefficients(example_set, 0.6 * near + 0.4 * far, distance_penalty=50.0)
    np.testing.assert_allclose(shares[:, 1], 1, atol=1e-4)


def test_hull_distance_is_of_the_subregion_that_leaves_it(example_set):
    """One subregion moves along what no example does: all of it is out of reach."""
    members = example_set.subregions.members[1]
    geometries = example_set.geometries
    seen = (geometries - geometries[0])[:, members].reshape(5, -1)
    outside = np.zeros_like(geometries[0])
    motion = _rigid(geometries[0])
    full = np.zeros((5, geometries[0].size)).reshape(5, -1, 2)
    full[:, members] = seen.reshape(5, -1, 2)
    blocked = np.linalg.svd(np.hstack([motion, full.reshape(5, -1).T]))[0][:, :9]
    step = np.zeros_like(geometries[0])
    step[members] = np.random.default_rng(1).normal(size=(len(members), 2))
    # Within the subregion, at right angles to head motion and to every example.
    basis = blocked.reshape(*step.shape, -1)[members].reshape(-1, 9)
    part = step[members].ravel()
    part -= basis @ np.linalg.lstsq(basis, part, rcond=None)[0]
    outside[members] = 5 * part.reshape(-1, 2) / np.sqrt(2 * np.mean(part**2))
    distances = hull_distances(example_set, geometries[0] + outside)
    np.testing.assert_allclose(distances, [0, 5], atol=0.01)


def test_one_example_is_all_there_is(example_set):
    alone = replace(example_set, examples=example_set.examples[:1])
    np.testing.assert_allclose(coefficients(alone, example_set.examples[2].points), 1)


@pytest.mark.parametrize("bad", [np.zeros((5, 2)), np.full((134, 2), np.nan)])
def test_bad_points(example_set, bad):
    with pytest.raises(InputError, match="points: expected"):
        coefficients(example_set, bad)


def test_a_negative_penalty(example_set):
    with pytest.raises(InputError, match="distance_penalty"):
        coefficients(example_set, example_set.neutral.points, distance_penalty=-1.0)


def test_a_negative_slack(example_set):
    with pytest.raises(InputError, match="slack"):
        coefficients(example_set, example_set.neutral.points, slack=-1.0)


def test_tied_subregions_have_the_same_coefficients(example_set):
    points = np.array(example_set.neutral.points)
    half = example_set.subregions.members[0]
    points[half] = example_set.examples[2].points[half]
    offsets = coefficients(example_set, points)
    shares = coefficients(example_set, points, tied=[("right", "left")])
    assert np.abs(offsets[0] - offsets[1]).max() > 0.1
    np.testing.assert_array_equal(shares[0], shares[1])
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-9)


def test_a_group_of_one_changes_nothing(example_set, rng):
    points = example_set.neutral.points + 9 * rng.normal(size=example_set.neutral.points.shape)
    alone = coefficients(example_set, points, tied=[("left",)])
    np.testing.assert_allclose(alone, coefficients(example_set, points))


@pytest.mark.parametrize(
    ("tied", "message"),
    [
        ([("ear",)], "tied: expected subregions of right, left, got ear"),
        ([("left",), ("right", "left")], "each subregion in one group, got left twice"),
    ],
)
def test_bad_groups(example_set, tied, message):
    with pytest.raises(InputError, match=message):
        coefficients(example_set, example_set.neutral.points, tied=tied)


def test_the_upper_face_is_of_the_subregions_that_ship():
    layout = load_feature_layout()
    drawn = default_subregions(layout, 100 + 200 * layout.template, (320, 400))
    assert set(BROWS) < set(UPPER_FACE) < set(drawn.names)


def test_the_brows_are_tied_by_default(example_set, rng):
    names = (*BROWS, "nose")
    members = np.array_split(np.arange(len(example_set.layout.names)), len(names))
    parted = replace(
        example_set,
        subregions=Subregions(names, np.full((30, 20, 4), 0.25, np.float32), tuple(members)),
    )
    points = example_set.neutral.points + 9 * rng.normal(size=example_set.neutral.points.shape)
    shares = coefficients(parted, points)
    np.testing.assert_array_equal(shares, coefficients(parted, points, tied=[BROWS]))
    assert (shares[:3] == shares[0]).all()
    assert np.abs(shares[3] - shares[0]).max() > 0.1
    assert np.abs(np.diff(coefficients(parted, points, tied=())[:3], axis=0)).max() > 0.1


@pytest.fixture(scope="module")
def with_teeth(example_set):
    """The same, the second subregion the teeth, which examples 1 and 3 show."""
    named = replace(example_set.subregions, names=("skin", "teeth"))
    return replace(example_set, subregions=named, teeth=(1, 3))


def test_teeth_are_made_from_those_that_show_teeth(with_teeth):
    geometries = with_teeth.geometries
    points = 0.85 * geometries[1] + 0.05 * geometries[3] + 0.1 * geometries[4]
    skin, teeth = coefficients(with_teeth, points)
    assert skin[4] > 0.05
    assert teeth[[0, 2, 4]].max() == 0
    assert teeth.min() >= 0
    assert teeth.sum() == pytest.approx(1)


def test_a_shut_mouth_is_made_from_shut_mouths(with_teeth):
    shares = coefficients(with_teeth, with_teeth.examples[2].points)
    np.testing.assert_allclose(shares, np.tile(np.eye(5)[2], (2, 1)), atol=1e-5)


def test_a_mouth_that_opens_gets_its_teeth_without_a_jump(with_teeth):
    shut, wide = with_teeth.geometries[2], with_teeth.geometries[1]
    places = shut + np.linspace(0, 1, 401)[:, None, None] * (wide - shut)
    found = np.array([coefficients(with_teeth, place)[1] for place in places])
    np.testing.assert_allclose(found[[0, -1]], np.eye(5)[[2, 1]], atol=1e-5)
    assert np.abs(np.diff(found, axis=0)).sum(axis=1).max() < 0.05


def test_teeth_tied_to_others_are_made_from_all(with_teeth):
    points = 0.6 * with_teeth.geometries[1] + 0.4 * with_teeth.geometries[4]
    shares = coefficients(with_teeth, points, tied=[("skin", "teeth")])
    assert shares[1, 4] > 0.1


def test_geometries_in_space_are_mixed_alike(example_set, rng):
    examples = rng.normal(size=(5, len(example_set.layout.names), 3))
    truth = np.array([0.1, 0.5, 0.0, 0.4, 0.0])
    offsets = examples - np.tensordot(truth, examples, axes=1)
    shares = coefficients_from_offsets(offsets, example_set.subregions, distance_penalty=0.0)
    np.testing.assert_allclose(shares, np.tile(truth, (2, 1)), atol=1e-5)
    np.testing.assert_allclose(
        mixture_distances(offsets, shares, example_set.subregions), 0, atol=1e-4
    )


def test_distances_are_of_the_points(example_set):
    offsets = np.zeros((1, len(example_set.layout.names), 3))
    offsets[0, example_set.subregions.members[1]] = [0.0, 3.0, 4.0]
    found = mixture_distances(offsets, np.ones((2, 1)), example_set.subregions)
    np.testing.assert_allclose(found, [0, 5])
