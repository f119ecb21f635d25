"""Subregions on the mesh of a head ([Zhang 2006] section 9)."""

from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC
from mien.assets.feature_points import load_feature_layout
from mien.synthesis.heads.subregions import head_subregions

HERE = head_subregions()
SKIN = GENERIC.mesh.vertices_of("skin")


def weight(name):
    return HERE.fades[:, HERE.names.index(name)]


def test_weights_sum_to_one_on_the_whole_head():
    assert HERE.fades.shape == (len(GENERIC.mesh.vertices), len(HERE.names))
    np.testing.assert_allclose(HERE.fades.sum(axis=1), 1, atol=1e-12)
    assert HERE.fades.min() >= -1e-12


def test_members_are_points_of_the_layout():
    count = len(load_feature_layout().names)
    assert all(len(members) and members.max() < count for members in HERE.members)
    assert len(HERE.members) == len(HERE.names)


def test_left_is_right_mirrored():
    for name in HERE.names:
        other = name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        np.testing.assert_allclose(weight(name)[GENERIC.mirror], weight(other), atol=1e-12)


@pytest.mark.parametrize(
    ("part", "name"),
    [
        ("left_eyeball", "left_eye"),
        ("right_eyeball", "right_eye"),
        ("upper_teeth", "teeth"),
        ("tongue", "teeth"),
    ],
)
def test_eyes_and_teeth_are_subregions_of_their_own(part, name):
    np.testing.assert_array_equal(weight(name)[GENERIC.mesh.vertices_of(part)], 1)
    np.testing.assert_array_equal(weight(name)[SKIN], 0)


@pytest.mark.parametrize(
    ("feature", "name"),
    [
        ("nose_tip", "nose"),
        ("chin", "chin"),
        ("lower_lip_inner.3", "lips"),
        ("upper_lip_inner.3", "lips"),
        ("left_upper_eyelid.3", "left_lids"),
        ("right_lower_eyelid.3", "right_lids"),
    ],
)
def test_features_lie_in_their_subregions(feature, name):
    assert weight(name)[GENERIC.vertex_of(feature)] > 0.9


def test_skin_below_the_jaw_belongs_to_the_chin():
    menton = GENERIC.mesh.vertices[GENERIC.vertex_of("left_jaw.0")]
    below = np.linalg.norm(GENERIC.mesh.vertices - (menton - [0, 0, 8]), axis=1) < 8
    assert weight("chin")[below].min() > 0.8


def test_there_is_no_step_on_the_skin_off_the_lips():
    corners = GENERIC.mesh.triangles[GENERIC.mesh.triangles_of("skin")]
    ends = np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends = ends[weight("lips")[ends].max(axis=1) == 0]
    length = np.linalg.norm(np.diff(GENERIC.mesh.vertices[ends], axis=1)[:, 0], axis=1)
    steps = np.abs(np.diff(HERE.fades[ends], axis=1)[:, 0])
    assert (steps.max(axis=1) / length).max() < 0.25


def test_lashes_belong_to_the_lids():
    lashes = GENERIC.mesh.vertices_of("lashes")
    assert (weight("left_lids") + weight("right_lids"))[lashes].min() > 0.9
