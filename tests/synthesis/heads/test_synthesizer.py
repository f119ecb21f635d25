"""Expressions of heads from feature points in space ([Zhang 2006] section 9)."""

from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC
from mien.errors import InputError
from mien.head import NEUTRAL, Expression
from mien.render.morph import MorphRenderer
from mien.render.orbit import orbit_camera
from mien.rig.gaze import with_turned_eyes
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.synthesizer import HeadSynthesizer
from mien.synthesis.synthesizer import SynthesisOptions
from posable import NAMES, REST, head, head_of, shapes

HEAD = HeadSynthesizer(head())
PLAIN = HeadSynthesizer(head(), SynthesisOptions.paper(), warp=False, rig=HEAD.rig)
LAYOUT = HEAD.layout


def points_of(name):
    return feature_points_on(shapes()[name])


def named(*starts):
    return np.array([name.startswith(starts) for name in LAYOUT.names])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("synthesizer", [HEAD, PLAIN])
def test_an_expressions_own_points_give_it_back(synthesizer, name):
    made = synthesizer.synthesize(points_of(name))
    np.testing.assert_allclose(made.face.vertices, shapes()[name], atol=1e-6)
    row = synthesizer.rig.names.index(name)
    np.testing.assert_array_equal(made.coefficients, np.eye(len(NAMES))[[row] * 14])
    np.testing.assert_array_equal(made.face.weights[:, row], 1)
    np.testing.assert_allclose(made.hull_mm, 0, atol=1e-6)


def test_its_picture_is_that_expressions():
    camera = orbit_camera(0.4, 0.0, 0.0, width=120, height=150, vertices=REST)
    renderer = MorphRenderer(head().mesh, HEAD.rig.textures)
    made = renderer.render(HEAD.synthesize(points_of("awe")).face, camera)
    shares = np.zeros((7, len(NAMES)))
    shares[:, HEAD.rig.names.index("awe")] = 1
    units = np.zeros(len(HEAD.rig.unit_names))
    own = renderer.render(HEAD.rig.posed(shares, units, np.zeros(2)), camera)
    np.testing.assert_array_equal(made, own)


def test_half_way_points_give_half_way_faces():
    half = (points_of("joy") + points_of("awe")) / 2
    made = PLAIN.synthesize(half)
    np.testing.assert_allclose(made.coefficients.sum(axis=1), 1, atol=1e-12)
    lips = made.coefficients[HEAD.subregions.names.index("lips")]
    wanted = [{"joy": 0.5, "awe": 0.5}.get(name, 0.0) for name in PLAIN.rig.names]
    np.testing.assert_allclose(lips, wanted, atol=2e-3)
    middle = (shapes()["joy"] + shapes()["awe"]) / 2
    off = np.linalg.norm(made.face.vertices - middle, axis=1)
    assert np.median(off) < 0.02
    np.testing.assert_allclose(made.hull_mm, 0, atol=0.02)


def test_each_subregion_takes_its_own_expression():
    points = points_of("anger").copy()
    mouth = named("right_upper_lip", "left_upper_lip", "right_lower_lip", "left_lower_lip")
    mouth |= named("upper_", "lower_", "right_mouth", "left_mouth", "chin", "menton", "right_inner")
    mouth |= named("left_inner", "left_chin", "right_chin", "right_upper_teeth", "left_upper_teeth")
    mouth |= named("right_lower_teeth", "left_lower_teeth")
    points[mouth] = points_of("awe")[mouth]
    made = HEAD.synthesize(points)
    for subregion, name in {"lips": "awe", "left_brow": "anger", "right_lids": "anger"}.items():
        row = made.coefficients[HEAD.subregions.names.index(subregion)]
        assert row[HEAD.rig.names.index(name)] > 0.9


def test_the_face_reaches_points_that_no_mixture_has():
    points = points_of(NEUTRAL).copy()
    brow = named("left_brow")
    points[brow] += [0, 4, 0]
    near, plain = HEAD.synthesize(points), PLAIN.synthesize(points)
    assert near.hull_mm[HEAD.subregions.names.index("left_brow")] > 1
    found = feature_points_on(near.face.vertices)
    np.testing.assert_allclose(found[brow], points[brow], atol=0.1)
    assert np.abs(feature_points_on(plain.face.vertices)[brow] - points[brow]).max() > 1


def test_eyes_look_where_their_pupils_are():
    looking = with_turned_eyes(REST, np.array([[0.3, 0.1], [0.2, 0.0]]), GENERIC)
    points = points_of("joy").copy()
    pupils = named("left_pupil", "right_pupil")
    points[pupils] = feature_points_on(looking)[pupils]
    face = HEAD.synthesize(points).face
    np.testing.assert_allclose(feature_points_on(face.vertices)[pupils], points[pupils], atol=0.1)


def test_some_points_determine_all():
    known = np.flatnonzero(named("left_mouth_corner", "left_upper_lip", "left_lower_lip"))
    completed = HEAD.complete(known, points_of("joy")[known])
    np.testing.assert_array_equal(completed[known], points_of("joy")[known])
    still, moved = points_of(NEUTRAL), points_of("joy")
    by_name = {name: points_of("joy")[LAYOUT.index(name)] for name in np.array(LAYOUT.names)[known]}
    np.testing.assert_array_equal(HEAD.complete(by_name), completed)
    left = np.abs(completed - moved).max()
    assert left < 0.5 * np.abs(still - moved).max()


@pytest.mark.parametrize("propagation", ["closed-form", "printed"])
def test_points_that_do_not_move_leave_the_face_at_rest(propagation):
    synthesizer = HeadSynthesizer(head(), SynthesisOptions(propagation=propagation), rig=HEAD.rig)
    completed = synthesizer.complete([3, 40, 80], points_of(NEUTRAL)[[3, 40, 80]])
    np.testing.assert_allclose(completed, points_of(NEUTRAL), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "by"), [("nose_tip", [0, 8, 0]), ("nose_tip", [6, 0, 0]), ("left_temple", [0, 6, 0])]
)
def test_a_point_of_little_variance_does_not_throw_the_others(name, by):
    """Nothing moves much farther than it does."""
    known = [LAYOUT.index(name)]
    rest = points_of(NEUTRAL)
    moved = np.linalg.norm(HEAD.complete(known, rest[known] + by) - rest, axis=1)
    assert moved.max() < 1.5 * np.linalg.norm(by)


def test_a_head_with_neutral_alone_moves_by_its_units():
    alone = head_of(expressions={NEUTRAL: Expression(REST)})
    synthesizer = HeadSynthesizer(alone)
    known = np.flatnonzero(named("left_brow"))
    completed = synthesizer.complete(known, points_of(NEUTRAL)[known] + [0, 4, 0])
    made = synthesizer.synthesize(completed)
    np.testing.assert_array_equal(made.coefficients, 1)
    found = feature_points_on(made.face.vertices)[known]
    np.testing.assert_allclose(found, completed[known], atol=0.1)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((5, 3)), "points: expected shape"),
        (np.zeros((len(LAYOUT.names), 2)), "points: expected shape"),
        (np.full((len(LAYOUT.names), 3), np.nan), "points: expected finite numbers"),
    ],
)
def test_bad_points_are_named(points, message):
    with pytest.raises(InputError, match=message):
        HEAD.synthesize(points)


@pytest.mark.parametrize(
    ("known", "positions", "message"),
    [
        ([], np.zeros((0, 3)), "known: expected indices of at least one point"),
        ([999], np.zeros((1, 3)), "known: expected points from 0"),
        ([4, 4], np.zeros((2, 3)), "known: expected each point once"),
        ([4], np.zeros((1, 2)), "displacements: expected shape"),
    ],
)
def test_bad_known_points_are_named(known, positions, message):
    with pytest.raises(InputError, match=message):
        HEAD.complete(known, positions)
