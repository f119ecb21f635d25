from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.reconstruction.shape.deformation import (
    ANCHOR_DISTANCE_MM,
    deform_head,
    eye_centers,
    vertex_uncertainty,
)
from people import person

GENERIC = load_generic_head()
HEAD = GENERIC.mesh.vertices
FEATURES = [GENERIC.vertex_of(name) for name in GENERIC.feature_names]
PLACES = HEAD[np.unique(FEATURES)]


def eyeball(name: str) -> np.ndarray:
    return GENERIC.mesh.vertices_of(name)


@pytest.mark.parametrize("kernel", ["exponential", "biharmonic", "triharmonic"])
def test_features_known_exactly_are_met_exactly(kernel: str) -> None:
    goals = person(5)[np.unique(FEATURES)]
    moved = deform_head(HEAD, PLACES, goals, GENERIC, kernel=kernel)
    np.testing.assert_allclose(moved[np.unique(FEATURES)], goals, atol=1e-6)


def test_nothing_moves_where_no_feature_does() -> None:
    np.testing.assert_allclose(deform_head(HEAD, PLACES, PLACES, GENERIC), HEAD, atol=1e-9)


def test_the_back_of_the_head_stays() -> None:
    goals = PLACES + np.random.default_rng(1).normal(size=PLACES.shape)
    moved = deform_head(HEAD, PLACES, goals, GENERIC)
    skin = GENERIC.mesh.vertices_of("skin")
    apart = np.linalg.norm(HEAD[skin, None] - PLACES, axis=2).min(axis=1)
    far = skin[apart > ANCHOR_DISTANCE_MM]
    assert len(far) > 200
    shift = np.linalg.norm(moved - HEAD, axis=1)
    assert np.median(shift[FEATURES]) > 1
    assert np.median(shift[far]) < 0.1
    assert shift[far].max() < 0.5


def test_a_head_with_features_all_over_needs_no_anchors() -> None:
    places = HEAD[::5]
    up = np.array([0, 1, 0])
    moved = deform_head(HEAD, places, places + up, GENERIC)
    np.testing.assert_allclose(moved, HEAD + up, atol=1e-9)


def test_a_feature_known_badly_moves_less() -> None:
    goals = PLACES.copy()
    goals[0] += [3, 0, 0]
    shifts = [
        deform_head(HEAD, PLACES, goals, GENERIC, deviation_mm=sigma)[np.unique(FEATURES)[0], 0]
        - PLACES[0, 0]
        for sigma in (0.0, 0.5, 2.0, 50.0)
    ]
    assert shifts[0] == pytest.approx(3)
    assert all(a > b for a, b in pairwise(shifts))
    assert 0 <= shifts[-1] < 0.1


def test_eyeballs_stay_round() -> None:
    moved = deform_head(HEAD, PLACES, person(6)[np.unique(FEATURES)], GENERIC)
    for name in ("left_eyeball", "right_eyeball"):
        ball = eyeball(name)
        before, after = (head[ball] - head[ball].mean(axis=0) for head in (HEAD, moved))
        ratio = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
        # It is turned and scaled, never mirrored or sheared: inner products keep.
        np.testing.assert_allclose(
            after @ after[0], ratio[0] ** 2 * (before @ before[0]), rtol=1e-6, atol=1e-6
        )


def test_eye_centers_are_the_left_then_the_right() -> None:
    left, right = eye_centers(GENERIC.mesh.with_vertices(HEAD))
    assert left[0] - right[0] == pytest.approx(63)
    assert left[0] == pytest.approx(-right[0])


def test_uncertainty_grows_with_the_distance_from_what_is_known() -> None:
    line = np.column_stack([np.linspace(0, 200, 50), np.zeros(50), np.zeros(50)])
    spread = vertex_uncertainty(line, np.zeros((1, 3)), np.array([0.25]), prior_mm=2.5)
    assert spread[0] == 0.25
    assert (np.diff(spread) >= 0).all()
    assert spread[-1] == pytest.approx(2.5)


def test_uncertainty_is_never_above_the_priors() -> None:
    spread = vertex_uncertainty(HEAD, PLACES, np.full(len(PLACES), np.inf), prior_mm=2.5)
    np.testing.assert_allclose(spread, 2.5)
