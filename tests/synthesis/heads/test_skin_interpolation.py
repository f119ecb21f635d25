"""Interpolation over the skin of a head ([Zhang 2006] section 9)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from marbled import GENERIC
from mien.assets.feature_points import load_feature_layout
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.skin_interpolation import (
    behind_lips_and_lids,
    harmonic_extension,
    thin_plate_weights,
)
from people import person

SKIN = GENERIC.mesh.vertices_of("skin")
COUNT = len(GENERIC.mesh.vertices)
LAYOUT = load_feature_layout()
POINTS = feature_points_on(GENERIC.mesh.vertices)
PUPILS = np.array(["pupil" in name for name in LAYOUT.names])
INSIDE = np.array(["teeth" in name or "lip_inner" in name for name in LAYOUT.names])


def outside():
    known = np.zeros(COUNT, bool)
    known[SKIN] = True
    return known & ~behind_lips_and_lids()


def test_known_values_stay(rng):
    values = rng.random((COUNT, 2))
    known = outside()
    np.testing.assert_array_equal(harmonic_extension(values, known)[known], values[known])
    eyes = GENERIC.mesh.vertices_of("left_eyeball", "tongue")
    np.testing.assert_array_equal(harmonic_extension(values, known)[eyes], values[eyes])


def test_a_constant_is_extended_inside_and_to_lashes():
    values = np.where(outside()[:, None], 3.0, np.nan)
    extended = harmonic_extension(np.nan_to_num(values), outside())
    hair = GENERIC.mesh.vertices_of("lashes", "hair")
    np.testing.assert_allclose(extended[np.concatenate([SKIN, hair])], 3)


def test_values_stay_in_the_range_of_the_known(rng):
    values = rng.random((COUNT, 1))
    extended = harmonic_extension(values, outside())
    assert extended.min() >= 0
    assert extended.max() <= 1


def test_a_socket_has_the_values_of_the_skin_before_it():
    """Height as the value: the middle of an eye socket lies at the height of its eye."""
    height = GENERIC.mesh.vertices[:, 1:2]
    extended = harmonic_extension(height, outside())
    inside = SKIN[GENERIC.regions["eye_socket"][SKIN] >= 0.5]
    assert np.abs(extended[inside] - height[inside]).mean() < 4


def test_skin_moves_with_its_points(rng):
    asked = rng.normal(size=POINTS.shape)
    asked[PUPILS | INSIDE] = 0
    found = feature_points_on(person(4) + thin_plate_weights() @ asked) - feature_points_on(
        person(4)
    )
    np.testing.assert_allclose(found[~(PUPILS | INSIDE)], asked[~(PUPILS | INSIDE)], atol=0.1)


def test_the_same_displacement_of_all_points_moves_the_face():
    along = thin_plate_weights().sum(axis=1)
    face = GENERIC.mesh.vertices_of("skin")
    inside = GENERIC.regions["mouth_cavity"] + GENERIC.regions["eye_socket"]
    near = cKDTree(POINTS).query(GENERIC.mesh.vertices)[0] < 8
    face = face[(near & (inside == 0) & (GENERIC.mesh.vertex_normals()[:, 2] > 0.3))[face]]
    np.testing.assert_allclose(along[face], 1, atol=0.2)
    away = GENERIC.mesh.vertices[:, 2] < -120
    assert np.abs(along[away]).max() < 0.1


@pytest.mark.parametrize("part", ["left_eyeball", "upper_teeth", "tongue"])
def test_other_parts_than_skin_stay(part):
    assert not thin_plate_weights()[GENERIC.mesh.vertices_of(part)].any()
