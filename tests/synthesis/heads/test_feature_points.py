"""Feature points on heads ([Zhang 2006] section 9)."""

from __future__ import annotations

import numpy as np

from marbled import GENERIC
from mien.assets.feature_points import load_feature_layout
from mien.rig.gaze import with_turned_eyes
from mien.synthesis.heads.feature_points import feature_points_on
from people import person

LAYOUT = load_feature_layout()
POINTS = feature_points_on(GENERIC.mesh.vertices)
PUPILS = np.array(["pupil" in name for name in LAYOUT.names])


def test_points_lie_at_the_features_of_their_names():
    for name in ("nose_tip", "chin", "nose_root"):
        vertex = GENERIC.mesh.vertices[GENERIC.vertex_of(name)]
        assert np.linalg.norm(POINTS[LAYOUT.index(name)] - vertex) < 5
    right = [name.startswith("right_") for name in LAYOUT.names]
    assert POINTS[right, 0].max() < 0


def test_points_are_as_symmetric_as_the_landmarks_attached():
    mirrored = POINTS[LAYOUT.mirror] * [-1, 1, 1]
    np.testing.assert_allclose(mirrored, POINTS, atol=3)


def test_points_of_many_heads_at_once():
    heads = np.stack([person(1), person(2)])
    np.testing.assert_allclose(feature_points_on(heads)[1], feature_points_on(heads[1]))


def test_points_of_offsets_are_offsets_of_points():
    moved = feature_points_on(GENERIC.mesh.vertices + GENERIC.unit_offsets[3])
    np.testing.assert_allclose(
        moved - POINTS, feature_points_on(GENERIC.unit_offsets[3]), atol=1e-5
    )


def test_pupils_turn_with_the_eyes():
    turned = with_turned_eyes(GENERIC.mesh.vertices, np.full((2, 2), [0.3, 0.0]), GENERIC)
    moved = feature_points_on(turned) - POINTS
    assert PUPILS.sum() == 2
    assert (moved[PUPILS, 0] > 2).all()
    np.testing.assert_allclose(moved[~PUPILS], 0, atol=1e-12)
