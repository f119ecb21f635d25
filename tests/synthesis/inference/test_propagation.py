"""Motion propagation ([Zhang 2006] sec. 10)."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.errors import InputError
from mien.numeric.pca import fit_pca
from mien.synthesis.inference.conditional import ConditionalGaussian
from mien.synthesis.inference.propagation import MotionPropagation, visiting_order
from moving import LAYOUT, POINTS, expressions

KNOWN = np.array([0, 3, 6, 9, 11, 14, 17, 20, 22])
PATIENT = {"max_iterations": 3000, "threshold": 1e-9}


def as_printed(statistics, sets, count, known, given, iterations):
    """The paper's text, word for word, its flags and recursion in every iteration."""

    def project(moved, points):
        pca = fit_pca(statistics[:, points].reshape(len(statistics), -1), count)
        return pca.project(moved[points].ravel()).reshape(-1, 2)

    def propagate_set(moved, level, index, processed):
        if (level, index) in processed:
            return
        moved[sets[level][index]] = project(moved, sets[level][index])
        processed.add((level, index))
        for neighbour in (level - 1, level + 1):
            if not 0 <= neighbour < len(sets):
                continue
            for other, points in enumerate(sets[neighbour]):
                if np.intersect1d(points, sets[level][index]).size:
                    propagate_set(moved, neighbour, other, processed)

    moved = np.zeros(statistics.shape[1:])
    for _ in range(iterations):
        moved[known] = given
        propagate_set(moved, 0, 0, set())
    return moved


def test_is_what_the_paper_prints(rng):
    statistics = expressions(rng, 6, noise=0.5)
    given = expressions(rng)[0, KNOWN]
    found = MotionPropagation(LAYOUT, statistics, components=3, threshold=1e-12, max_iterations=7)
    np.testing.assert_allclose(
        found.infer(KNOWN, given).displacements,
        as_printed(statistics, LAYOUT.sets, 3, KNOWN, given, 7),
        atol=1e-9,
    )


def test_an_expression_in_the_subspace_is_found_from_some_points(rng):
    statistics = expressions(rng)
    for truth in statistics[:3]:
        found = MotionPropagation(LAYOUT, statistics, components=4, **PATIENT).infer(
            KNOWN, truth[KNOWN]
        )
        np.testing.assert_allclose(found.displacements, truth, atol=1e-4)


def test_all_points_known_reproduce_themselves_at_once(rng):
    statistics = expressions(rng)
    found = MotionPropagation(LAYOUT, statistics, components=4).infer(
        np.arange(POINTS), statistics[5]
    )
    np.testing.assert_allclose(found.displacements, statistics[5], atol=1e-9)
    assert found.errors[0] == pytest.approx(0, abs=1e-9)


def test_a_large_weight_of_known_points_needs_few_iterations(rng):
    statistics = expressions(rng)
    truth = statistics[7]
    found = MotionPropagation(LAYOUT, statistics, components=4, known_weight=100).infer(
        KNOWN, truth[KNOWN]
    )
    np.testing.assert_allclose(found.displacements, truth, atol=0.05)
    printed = MotionPropagation(LAYOUT, statistics, components=4, threshold=1e-9, max_iterations=5)
    slower = printed.infer(KNOWN, truth[KNOWN]).displacements
    assert np.abs(slower - truth).max() > 1


def test_the_weight_of_known_points_changes_nothing_where_all_are_known(rng):
    statistics = expressions(rng, 6, noise=0.5)
    given = 3 * statistics[0]
    found = [
        MotionPropagation(LAYOUT, statistics, components=3, known_weight=weight).infer(
            np.arange(POINTS), given
        )
        for weight in (0.0, 1.0)
    ]
    np.testing.assert_allclose(found[0].displacements, found[1].displacements)


def test_a_prior_shrinks_displacements_towards_the_mean(rng):
    statistics = expressions(rng, noise=1.0)
    given = 5 * statistics[0, KNOWN]
    spans = [
        np.abs(
            MotionPropagation(LAYOUT, statistics, components=4, prior_weight=weight, **PATIENT)
            .infer(KNOWN, given)
            .displacements
        ).sum()
        for weight in (0.0, 1.0, 10.0)
    ]
    assert spans[0] > spans[1] > spans[2]


@pytest.mark.parametrize("options", [{}, {"known_weight": 10.0, "prior_weight": 1.0}])
def test_the_order_of_the_known_points_does_not_matter(rng, options):
    statistics = expressions(rng, noise=0.5)
    order = rng.permutation(len(KNOWN))
    given = statistics[0, KNOWN]
    propagation = MotionPropagation(LAYOUT, statistics, components=4, **options)
    np.testing.assert_array_equal(
        propagation.infer(KNOWN[order], given[order]).displacements,
        propagation.infer(KNOWN, given).displacements,
    )


def test_stops_when_two_iterations_changed_little(rng):
    statistics = expressions(rng, 6, noise=0.5)
    given = statistics[0, KNOWN]

    def after(iterations, threshold=1e-12):
        limited = MotionPropagation(
            LAYOUT, statistics, components=4, threshold=threshold, max_iterations=iterations
        )
        return limited.infer(KNOWN, given)

    stopped = after(500, threshold=0.01).iterations
    assert 2 < stopped < 500
    results = [np.zeros_like(given)]
    results += [after(i + 1).displacements[KNOWN] for i in range(stopped)]
    progress = [np.linalg.norm(b - a, axis=1).mean() for a, b in itertools.pairwise(results)]
    averages = np.convolve(progress, [0.5, 0.5], mode="valid")
    assert averages[-1] < 0.01
    assert (averages[:-1] >= 0.01).all()


def test_stops_at_the_last_iteration_allowed(rng):
    statistics = expressions(rng, 6, noise=0.5)
    found = MotionPropagation(LAYOUT, statistics, threshold=1e-12, max_iterations=9)
    assert found.infer(KNOWN, statistics[0, KNOWN]).iterations == 9


def test_one_point_that_does_not_move_is_enough_input(rng):
    found = MotionPropagation(LAYOUT, expressions(rng)).infer(np.array([4]), np.zeros((1, 2)))
    assert np.isfinite(found.displacements).all()


def test_points_of_unreached_sets_do_not_move(rng):
    separate = SimpleNamespace(sets=((np.arange(12),), (np.arange(8, 16),), (np.arange(18, 24),)))
    statistics = expressions(rng)
    found = MotionPropagation(separate, statistics, components=4).infer(
        np.array([2]), np.ones((1, 2))
    )
    np.testing.assert_array_equal(found.displacements[16:], 0)
    assert np.abs(found.displacements[12:16]).min() > 0


def test_the_first_hierarchy_with_a_known_point_is_visited_first():
    sets = LAYOUT.sets
    without_whole = ((np.array([0, 1]),), *sets[1:])
    assert visiting_order(sets, np.array([23]))[0] == (0, 0)
    assert visiting_order(without_whole, np.array([23]))[0] == (1, 1)


def test_each_set_is_done_once_parents_before_children():
    order = visiting_order(LAYOUT.sets, np.array([23]))
    # From the whole to its first half and at once to its quarters; the second of these, which
    # reaches into the other half, goes up to it before the first half has its third.
    assert order == [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (2, 2), (2, 3)]


def test_the_layout_that_ships_reaches_all_sets_from_any_point():
    layout = load_feature_layout()
    assert [len(level) for level in layout.sets] == [1, 4, 16]
    for point in range(len(layout.names)):
        assert len(visiting_order(layout.sets, np.array([point]))) == 21


@pytest.mark.parametrize(
    ("known", "displacements", "message"),
    [
        ([], np.zeros((0, 2)), "known: expected indices of at least one point"),
        ([24], np.zeros((1, 2)), "known: expected points from 0 to 23, got 24"),
        ([-1], np.zeros((1, 2)), "known: expected points from 0 to 23, got -1"),
        ([3, 1, 3], np.zeros((3, 2)), "known: expected each point once, got point 3 twice"),
        ([0.5], np.zeros((1, 2)), "known: expected indices of points"),
        ([0], np.full((1, 2), np.nan), "displacements: expected finite numbers"),
        ([0, 1], np.zeros((1, 2)), "displacements: expected shape"),
    ],
)
def test_bad_points_are_named(rng, known, displacements, message):
    with pytest.raises(InputError, match=message):
        MotionPropagation(LAYOUT, expressions(rng)).infer(known, displacements)


def test_known_points_in_no_set_are_refused(rng):
    few = SimpleNamespace(sets=((np.arange(12),),))
    with pytest.raises(InputError, match="known: expected a point that belongs to a set"):
        MotionPropagation(few, expressions(rng), components=4).infer([20], np.ones((1, 2)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"components": 0}, "components: expected a number from 1 on"),
        ({"components": (3, 3)}, "components: expected one number, or 3"),
        ({"known_weight": -1}, "known_weight: expected a number of 0 or more"),
        ({"prior_weight": -1}, "prior_weight: expected a number of 0 or more"),
        ({"prior_weight": np.nan}, "prior_weight: expected finite numbers"),
        ({"threshold": 0}, "threshold: expected a number above zero"),
        ({"max_iterations": 0}, "max_iterations: expected a number from 1 on"),
    ],
)
def test_bad_options_are_named(rng, options, message):
    with pytest.raises(InputError, match=message):
        MotionPropagation(LAYOUT, expressions(rng), **options)


@pytest.mark.parametrize(
    ("statistics", "message"),
    [
        (np.zeros((1, POINTS, 2)), "statistics: expected 2 expressions or more, got 1"),
        (np.zeros((5, POINTS)), "statistics: expected shape"),
        (np.full((5, POINTS, 2), np.nan), "statistics: expected finite numbers"),
        (np.zeros((5, 10, 2)), "statistics: expected all points of the layout's sets"),
    ],
)
def test_bad_statistics_are_named(statistics, message):
    with pytest.raises(InputError, match=message):
        MotionPropagation(LAYOUT, statistics)


def test_a_layout_without_sets_is_refused(rng):
    with pytest.raises(InputError, match="layout: expected at least one set"):
        MotionPropagation(SimpleNamespace(sets=()), expressions(rng), components=4)


@pytest.mark.parametrize(
    "model",
    [
        lambda statistics: ConditionalGaussian(statistics, components=4, min_noise=1e-6),
        lambda statistics: MotionPropagation(LAYOUT, statistics, components=4, **PATIENT),
    ],
)
def test_points_in_space_are_found_in_the_same_way(rng, model):
    """The flat expressions, turned in space, are found as they are in the plane."""
    statistics = expressions(rng) @ np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    found = model(statistics).infer(KNOWN, statistics[3, KNOWN])
    np.testing.assert_allclose(found.displacements, statistics[3], atol=1e-5)
    with pytest.raises(InputError, match=r"displacements: expected shape \(1, 3\)"):
        model(statistics).infer([0], np.zeros((1, 2)))
