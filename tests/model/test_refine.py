"""Shape refinement."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.model.rays import intersect_rays
from mien.model.refine import refine_shape


@pytest.fixture
def vertices(rng):
    return rng.uniform(-100, 100, (300, 3))


def test_feature_vertices_come_to_lie_on_the_points(rng, vertices):
    chosen = rng.permutation(300)[:40]
    goals = vertices[chosen] + rng.normal(size=(40, 3))
    np.testing.assert_allclose(refine_shape(vertices, chosen, goals)[chosen], goals, atol=1e-8)


def test_an_affine_change_carries_over_to_every_vertex(rng, vertices):
    matrix, shift = np.eye(3) + 0.1 * rng.normal(size=(3, 3)), rng.normal(size=3)
    chosen = np.arange(20)
    moved = refine_shape(vertices, chosen, vertices[chosen] @ matrix.T + shift)
    np.testing.assert_allclose(moved, vertices @ matrix.T + shift, atol=1e-8)


def test_unknown_and_weightless_points_are_passed_over(rng, vertices):
    goals = vertices[:12] + 1.0
    goals[3], goals[4] = np.nan, 1e3
    weights = np.ones(12)
    weights[4] = 0
    moved = refine_shape(vertices, np.arange(12), goals, weights=weights)
    np.testing.assert_allclose(moved, vertices + 1, atol=1e-8)


def test_weights_tell_which_points_to_meet_when_smoothing(rng, vertices):
    goals = vertices[:30] + 3 * rng.normal(size=(30, 3))
    weights = np.where(np.arange(30) < 15, 1e4, 1e-2)
    off = refine_shape(vertices, np.arange(30), goals, smoothing=0.01, weights=weights)[:30] - goals
    assert np.abs(off[:15]).max() < 0.1 * np.abs(off[15:]).max()


def test_a_vertex_named_twice_goes_to_the_mean(vertices):
    goals = np.vstack([vertices[:10], vertices[:1] + 2])
    moved = refine_shape(vertices, [*range(10), 0], goals)
    np.testing.assert_allclose(moved[0], vertices[0] + 1, atol=1e-8)


def test_repeated_with_rays_until_the_features_are_met(make_scene):
    """Cameras known, features marked: the generic vertices arrive at the person's."""
    scene = make_scene(0, hidden=False)
    found = intersect_rays(scene.cameras, scene.image_points[:, :40])
    shape = refine_shape(scene.generic, np.arange(40), found.points)
    np.testing.assert_allclose(shape[:40], scene.points[:40], atol=1e-7)
    before = np.linalg.norm(scene.generic[40:] - scene.points[40:], axis=1)
    after = np.linalg.norm(shape[40:] - scene.points[40:], axis=1)
    assert np.median(after) < 0.5 * np.median(before)
    again = refine_shape(shape, np.arange(40), found.points)
    np.testing.assert_allclose(again, shape, atol=1e-7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": np.zeros((5, 2))}, r"vertices: expected shape \(any, 3\)"),
        (
            {"feature_vertices": [0, 300]},
            "feature_vertices: expected indices from 0 to 299, got 300",
        ),
        ({"feature_points": np.zeros((3, 3))}, r"feature_points: expected shape \(2, 3\)"),
        ({"weights": [-1.0, 1.0]}, "weights: expected numbers of 0 or more, got -1.0"),
        ({"kernel": "cubic"}, "kernel: expected exponential"),
    ],
)
def test_refuses_bad_input(vertices, change, message):
    given = {"vertices": vertices, "feature_vertices": [0, 1], "feature_points": np.zeros((2, 3))}
    with pytest.raises(InputError, match=message):
        refine_shape(**{**given, **change})


def test_says_when_nothing_is_known(vertices):
    with pytest.raises(EstimationError, match="no feature point is known"):
        refine_shape(vertices, [0, 1], np.full((2, 3), np.nan))
