from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC, at
from mien.arrays import Array
from mien.errors import InputError
from mien.head import Expression, Head
from mien.mesh import Mesh
from mien.render.morph import MorphRenderer
from mien.render.shade import render
from mien.rig.gaze import Eyeball, eye_look_angles, with_turned_eyes
from mien.rig.regions import default_masks
from mien.rig.rig import WEIGHTED_REGIONS, Rig, region_rows
from mien.rig.state import FaceState, Gaze, PosedFace
from posable import (
    ANGER_GAZE,
    EYES,
    NAMES,
    REST,
    UNITS,
    explained_by,
    head,
    head_of,
    shapes,
    texture,
)

RIG = Rig(head())
SHAPES = shapes()
MASKS = default_masks(GENERIC)
NOT_EYES = np.setdiff1d(np.arange(len(REST)), EYES)
REGIONS = ("face", "left_mouth", "right_mouth", "eyes", "left_forehead", "right_forehead")


def showing(**expressions: float) -> FaceState:
    return FaceState({"face": expressions})


def only(name: str) -> Array:
    return np.eye(len(NAMES))[NAMES.index(name)]


def posed(state: FaceState) -> PosedFace:
    """Away from contacts, which are no sums."""
    return RIG.evaluate(state, contacts=False)


@pytest.mark.parametrize("name", NAMES)
def test_weight_one_is_that_very_expression(name: str) -> None:
    face = RIG.evaluate(showing(**{name: 1.0}))
    np.testing.assert_allclose(face.vertices, SHAPES[name], rtol=0, atol=1e-6)
    np.testing.assert_allclose(face.weights, np.tile(only(name), (len(REST), 1)), atol=1e-12)
    np.testing.assert_allclose(face.brightness, 1, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_weight_one_renders_that_expression(name: str) -> None:
    known, camera = head(), at(15, 5)
    face = RIG.evaluate(showing(**{name: 1.0}))
    drawn = MorphRenderer(known.mesh, RIG.textures).render(face, camera)
    own = known.textures[known.expressions[name].texture]
    alone = render(known.expression_mesh(name), camera, own, samples=4)
    assert np.abs(drawn.astype(int) - alone).max() <= 1


def test_names_and_textures_go_together() -> None:
    assert RIG.names == NAMES
    for name, pixels in zip(RIG.names, RIG.textures, strict=True):
        own = head().textures[head().expressions[name].texture]
        np.testing.assert_array_equal(pixels, own)


def test_neutral_comes_first_wherever_the_head_has_it() -> None:
    turned = dict(reversed(head().expressions.items()))
    rig = Rig(head_of(expressions=turned))
    assert rig.names == ("neutral", "awe", "anger", "joy")
    np.testing.assert_array_equal(rig.textures[0], head().textures["atlas"])
    face = rig.evaluate(showing(joy=1.0))
    np.testing.assert_allclose(face.vertices, SHAPES["joy"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_convex_mixture_stays_between(seed: int) -> None:
    """Whatever each region mixes: no coordinate, no texture goes past the expressions'."""
    rng = np.random.default_rng(seed)
    mixtures = rng.dirichlet(np.full(4, 0.6), len(REGIONS))
    by_region = {
        region: dict(zip(NAMES, weights.tolist(), strict=True))
        for region, weights in zip(REGIONS, mixtures, strict=True)
    }
    face = posed(FaceState(by_region))
    known = np.stack(list(SHAPES.values()))[:, NOT_EYES]
    assert (face.vertices[NOT_EYES] >= known.min(axis=0) - 1e-9).all()
    assert (face.vertices[NOT_EYES] <= known.max(axis=0) + 1e-9).all()
    assert face.weights.min() >= -1e-12
    assert face.weights.max() <= 1 + 1e-12
    np.testing.assert_allclose(face.weights.sum(axis=1), 1, atol=1e-9)


def test_half_way_is_half_way() -> None:
    face = posed(showing(joy=0.5, awe=0.25))
    expected = 0.25 * REST + 0.5 * SHAPES["joy"] + 0.25 * SHAPES["awe"]
    np.testing.assert_allclose(face.vertices, expected, atol=1e-9)
    np.testing.assert_allclose(face.weights, np.tile([0.25, 0.5, 0, 0.25], (len(REST), 1)))


def test_expressions_may_be_exaggerated() -> None:
    face = posed(showing(joy=1.5))
    np.testing.assert_allclose(face.vertices, 1.5 * SHAPES["joy"] - 0.5 * REST, atol=1e-9)
    np.testing.assert_allclose(face.weights.sum(axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(face.weights[0], [-0.5, 1.5, 0, 0], atol=1e-9)


def test_one_weight_of_one_is_not_one_expression_if_others_cancel() -> None:
    """1 + 0.5 - 0.5 = 1: a mixture for all that."""
    face = posed(showing(joy=1.0, awe=0.5))
    expected = -0.5 * REST + SHAPES["joy"] + 0.5 * SHAPES["awe"]
    np.testing.assert_allclose(face.vertices, expected, atol=1e-9)
    np.testing.assert_allclose(face.weights[0], [-0.5, 1, 0, 0.5], atol=1e-9)


def test_weights_by_region() -> None:
    face = posed(FaceState({"face": {"joy": 1.0}, "mouth": {"awe": 1.0}}))
    mouth = MASKS["left_mouth"] + MASKS["right_mouth"]
    np.testing.assert_allclose(face.weights[:, NAMES.index("awe")], mouth, atol=1e-6)
    np.testing.assert_allclose(face.weights[:, NAMES.index("joy")], 1 - mouth, atol=1e-6)
    within, without = np.flatnonzero(mouth > 1 - 1e-9), np.flatnonzero(mouth == 0)
    assert min(len(within), len(without)) > 500
    np.testing.assert_allclose(face.vertices[within], SHAPES["awe"][within], atol=1e-6)
    np.testing.assert_allclose(face.vertices[without], SHAPES["joy"][without], atol=1e-6)


def test_a_half_holds_instead_of_the_whole() -> None:
    given = {"face": {"joy": 1.0}, "mouth": {"awe": 1.0}, "left_mouth": {"anger": 1.0}}
    face = posed(FaceState(given))
    np.testing.assert_allclose(face.weights[:, 2], MASKS["left_mouth"], atol=1e-6)
    np.testing.assert_allclose(face.weights[:, 3], MASKS["right_mouth"], atol=1e-6)
    alone = posed(FaceState({"left_mouth": {"anger": 1.0}}))
    np.testing.assert_allclose(alone.weights[:, 2], MASKS["left_mouth"], atol=1e-6)
    np.testing.assert_allclose(alone.weights[:, 0], 1 - MASKS["left_mouth"], atol=1e-6)


def test_the_rest_of_the_head_holds_the_faces_weights() -> None:
    everything = {"mouth": {"joy": 1.0}, "eyes": {"joy": 1.0}, "forehead": {"joy": 1.0}}
    rest = 1 - sum(MASKS.values())
    face = posed(FaceState({"face": {"awe": 0.5}, **everything}))
    np.testing.assert_allclose(face.weights[:, NAMES.index("awe")], 0.5 * rest, atol=1e-6)
    still = posed(FaceState(everything))
    beyond = rest > 1 - 1e-9
    assert beyond.sum() > 500
    np.testing.assert_allclose(still.vertices[beyond], REST[beyond], atol=1e-9)


def test_the_heads_own_masks_count() -> None:
    """As much as they say, also where they sum to less than 1 everywhere."""
    half = np.full(len(REST), 0.4)
    rig = Rig(head_of(regions={"left_mouth": half, "right_mouth": half}))
    face = rig.evaluate(FaceState({"mouth": {"awe": 1.0}}), contacts=False)
    np.testing.assert_allclose(face.weights, np.tile([0.2, 0, 0, 0.8], (len(REST), 1)))
    untouched = rig.evaluate(FaceState({"forehead": {"awe": 1.0}}), contacts=False)
    np.testing.assert_allclose(untouched.vertices, REST, atol=1e-9)


def test_units_add_linearly() -> None:
    units = {"cheekPuff": 0.7, "noseSneerLeft": 0.4, "jawLeft": -0.2}
    face = posed(FaceState(units=units))
    np.testing.assert_allclose(face.vertices, explained_by(units), atol=1e-6)
    np.testing.assert_allclose(face.weights[:, 0], 1, atol=1e-12)
    mixed = posed(FaceState({"face": {"joy": 0.5}}, units))
    expected = explained_by(units) + 0.5 * (SHAPES["joy"] - REST)
    np.testing.assert_allclose(mixed.vertices, expected, atol=1e-6)


def test_contacts_concern_lids_and_lips_alone() -> None:
    state = FaceState({"face": {"awe": 0.3}}, {"mouthClose": 0.2, "eyeBlinkLeft": 0.8})
    touching, through = RIG.evaluate(state), posed(state)
    around = np.max(
        [GENERIC.regions[n] for n in ("mouth", "mouth_cavity", "eyes", "eye_socket")], 0
    )
    lashes = GENERIC.mesh.vertices_of("lashes", "hair")
    away = np.setdiff1d(np.flatnonzero(around == 0), np.union1d(lashes, EYES))
    np.testing.assert_allclose(touching.vertices[away], through.vertices[away], atol=1e-9)


@pytest.mark.parametrize("name", ["joy", "anger", "awe"])
def test_residuals_follow_the_units_of_their_expression(name: str) -> None:
    """Its residual and its texture, wherever its units have a say; a sparing share is missing."""
    face = posed(FaceState(units=UNITS[name]))
    residual = SHAPES[name] - explained_by(UNITS[name])
    residual[EYES] = 0
    missing = SHAPES[name] - face.vertices
    missing[EYES] = 0
    shares = face.weights[:, NAMES.index(name)]
    rest = 1 - sum(MASKS.values())
    concerned = {"joy": "mouth", "anger": "forehead", "awe": "mouth"}[name]
    there = MASKS[f"left_{concerned}"] + MASKS[f"right_{concerned}"] + rest > 1 - 1e-9
    assert there.sum() > 1000
    assert (shares[there] > 0.97).all()
    assert (face.weights[:, 0] + shares > 1 - 1e-3).all()
    lengths, off = (np.linalg.norm(moved, axis=1) for moved in (residual, missing))
    assert (off[there] <= 0.03 * lengths[there] + 1e-6).all()
    assert lengths[there].max() > 1


def test_half_the_units_add_half_the_residual() -> None:
    half = {unit: 0.5 * weight for unit, weight in UNITS["awe"].items()}
    face = posed(FaceState(units=half))
    lower = MASKS["left_mouth"] + MASKS["right_mouth"] > 1 - 1e-9
    np.testing.assert_allclose(face.weights[lower, NAMES.index("awe")], 0.5, atol=0.01)


def test_residuals_are_not_added_to_their_own_expression() -> None:
    face = posed(FaceState({"face": {"awe": 1.0}}, UNITS["awe"]))
    np.testing.assert_allclose(face.weights, np.tile(only("awe"), (len(REST), 1)), atol=1e-12)
    expected = SHAPES["awe"] + explained_by(UNITS["awe"]) - REST
    np.testing.assert_allclose(face.vertices, expected, atol=1e-6)


@pytest.mark.parametrize("weight", [-0.3, 0.4, 1.0, 1.5])
def test_eyes_turn_by_the_weight_of_the_expressions_gaze(weight: float) -> None:
    """Rigidly: a mixture of turned eyeballs would shrink them."""
    face = posed(showing(anger=weight))
    for side, (yaw, pitch) in zip(("left", "right"), weight * ANGER_GAZE, strict=True):
        eyeball = Eyeball.of(GENERIC, REST, side)
        before, after = REST[eyeball.vertices], face.vertices[eyeball.vertices]
        np.testing.assert_allclose(after, eyeball.turned(before, yaw, pitch), atol=1e-6)
        centre = before.mean(axis=0)
        distances = [np.linalg.norm(points - centre, axis=1) for points in (before, after)]
        np.testing.assert_allclose(distances[1], distances[0], atol=1e-6)


@pytest.mark.parametrize("name", NAMES[1:])
def test_the_way_to_an_expression_is_continuous(name: str) -> None:
    before, there = (posed(showing(**{name: weight})) for weight in (1 - 1e-6, 1.0))
    np.testing.assert_allclose(before.vertices, there.vertices, rtol=0, atol=1e-4)


def test_gaze_turns_the_eyes_of_any_face() -> None:
    face = posed(FaceState({"face": {"awe": 1.0}}, gaze=Gaze(0.2, 0.1)))
    eyeball = Eyeball.of(GENERIC, REST, "right")
    expected = eyeball.turned(REST[eyeball.vertices], 0.2, 0.1)
    np.testing.assert_allclose(face.vertices[eyeball.vertices], expected, atol=1e-6)


def test_eyes_of_an_expression_turn_on_when_a_unit_turns_them() -> None:
    face = posed(FaceState({"face": {"anger": 1.0}}, {"eyeLookUpLeft": 0.6}))
    eyeball = Eyeball.of(GENERIC, REST, "left")
    yaw, pitch = ANGER_GAZE[0]
    expected = eyeball.turned(REST[eyeball.vertices], yaw, pitch)
    expected = eyeball.turned(
        expected, *np.multiply(0.6, eye_look_angles(GENERIC)["eyeLookUpLeft"])
    )
    np.testing.assert_allclose(face.vertices[eyeball.vertices], expected, atol=1e-6)


def test_arrays_and_states_give_the_same_face() -> None:
    state = FaceState({"mouth": {"awe": 0.6}, "face": {"joy": 0.3}}, {"jawOpen": 0.4}, Gaze(0.2))
    mouth, rest = [0.4, 0, 0, 0.6], [0.7, 0.3, 0, 0]
    rows = region_rows(("mouth", "face"))
    np.testing.assert_array_equal(rows, [1, 1, 2, 2, 2, 2, 2])
    by_region = np.array([only("neutral"), mouth, rest])[rows]
    units = 0.4 * np.eye(len(RIG.unit_names))[RIG.unit_names.index("jawOpen")]
    numbers, face = RIG.posed(by_region, units, np.array([0.2, 0.0])), RIG.evaluate(state)
    for field in ("vertices", "weights", "brightness"):
        np.testing.assert_allclose(getattr(numbers, field), getattr(face, field), atol=1e-9)


def test_regions_take_the_nearest_given_weights() -> None:
    given = ("eyes", "left_mouth", "forehead")
    assert WEIGHTED_REGIONS[-1] == "face"
    np.testing.assert_array_equal(region_rows(given), [2, 0, 1, 1, 3, 3, 0])
    np.testing.assert_array_equal(region_rows(()), np.zeros(7))
    with pytest.raises(InputError, match=r"region: expected .* such as mouth, got muoth"):
        region_rows(("muoth",))


def test_eyes_darken_as_their_lids_close() -> None:
    left, right = (GENERIC.mesh.vertices_of(f"{side}_eyeball") for side in ("left", "right"))
    faces = [RIG.evaluate(FaceState(units={"eyeBlinkLeft": w})) for w in (0, 0.25, 0.5, 0.75, 1)]
    light = [face.brightness[left[0]] for face in faces]
    assert light[0] == pytest.approx(1)
    assert (np.diff(light) < -0.02).all()
    for face in faces:
        assert np.ptp(face.brightness[left]) == 0
        np.testing.assert_allclose(face.brightness[right], 1, atol=0.01)
        np.testing.assert_array_equal(face.brightness[GENERIC.mesh.vertices_of("skin")], 1)


def test_teeth_get_brighter_as_the_mouth_opens() -> None:
    teeth = GENERIC.mesh.vertices_of("upper_teeth", "lower_teeth", "tongue")
    faces = [RIG.evaluate(FaceState(units={"jawOpen": w})) for w in (0, 0.1, 0.3)]
    light = [face.brightness[teeth[0]] for face in faces]
    assert light[0] == pytest.approx(1)
    assert (np.diff(light) > 0.02).all()
    assert all(np.ptp(face.brightness[teeth]) == 0 for face in faces)


def test_notes_name_extrapolated_expressions() -> None:
    assert RIG.hull_notes(showing(joy=0.7, awe=0.3)) == ()
    (note,) = RIG.hull_notes(FaceState({"face": {"joy": 1.0}, "mouth": {"awe": 1.2}}))
    assert note.startswith("mouth: past what was photographed")
    assert note.endswith("neutral -0.2, awe 1.2")


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (showing(joi=1.0), "expression: expected one of the head's, such as joy, got joi"),
        (showing(rage=1.0), "expression: expected one of the head's, such as .*, got rage"),
        (FaceState(units={"jawOpne": 1}), "unit: expected .* such as jawOpen, got jawOpne"),
        (FaceState({"muoth": {}}), "region: expected .* such as mouth, got muoth"),
        (showing(joy=1.6), "weight of joy: expected -0.5 to 1.5, got 1.6"),
        (showing(joy=-0.51), "weight of joy: expected -0.5 to 1.5, got -0.51"),
        (showing(joy=np.nan), "weight of joy: expected -0.5 to 1.5, got nan"),
        (showing(joy=1.0, awe=0.6), "weight of neutral: expected -0.5 to 1.5, got -0.6"),
        (showing(neutral=0.5, awe=0.4), "weights: expected weights that sum to 1, got .* 0.9"),
        (FaceState({"eyes": {"awe": 2.0}}), "weight of awe: expected -0.5 to 1.5, got 2"),
        (FaceState(units={"jawOpen": np.inf}), "unit jawOpen: expected -0.5 to 1.5, got inf"),
    ],
)
def test_bad_states_are_refused(state: FaceState, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RIG.evaluate(state)
    if state.expressions and "muoth" not in state.expressions:
        with pytest.raises(InputError, match=message):
            RIG.hull_notes(state)


def test_the_limits_themselves_are_allowed() -> None:
    for state in (showing(joy=1.5), showing(joy=-0.5), showing(joy=1.5, awe=-0.5)):
        assert np.isfinite(RIG.evaluate(state).vertices).all()


def test_bad_heads_are_refused() -> None:
    corner = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    other = Head("Nobody", corner, {"neutral": Expression(np.eye(3))}, np.ones(3))
    with pytest.raises(InputError, match="head: expected the generic head's 5474 vertices, got 3"):
        Rig(other)
    with pytest.raises(InputError, match="head: expected a texture of neutral, got none"):
        Rig(head_of(textures={}))
    textures = head().textures | {"joy": texture(5, 32)}
    message = "texture of joy: expected 64x64 as neutral's, got 32x32"
    with pytest.raises(InputError, match=message):
        Rig(head_of(textures=textures))


def test_an_expression_without_a_texture_has_that_of_neutral() -> None:
    textures = {name: pixels for name, pixels in head().textures.items() if name != "awe"}
    rig = Rig(head_of(textures=textures))
    np.testing.assert_array_equal(rig.textures[3], rig.textures[0])


def test_neutral_alone_can_smile() -> None:
    alone = {"neutral": head().expressions["neutral"]}
    rig = Rig(replace(head(), expressions=alone))
    face = rig.evaluate(FaceState(units=UNITS["joy"]), contacts=False)
    np.testing.assert_allclose(face.vertices, explained_by(UNITS["joy"]), atol=1e-6)
    np.testing.assert_allclose(face.weights, 1, atol=1e-12)


def test_one_state_is_one_face() -> None:
    """Whatever was asked before, by whichever rig."""
    units = {"jawOpen": 0.3, "eyeBlinkLeft": 0.4}
    state = FaceState({"face": {"joy": 0.6}, "eyes": {"anger": 0.5}}, units, Gaze(0.1, 0.05))
    first = RIG.evaluate(state)
    RIG.evaluate(showing(awe=1.0))
    for again in (RIG.evaluate(state), Rig(head_of()).evaluate(state)):
        for field in ("vertices", "weights", "brightness"):
            assert getattr(again, field).tobytes() == getattr(first, field).tobytes()


def test_every_vertex_may_have_weights_of_its_own() -> None:
    weights = np.zeros((len(REST), 4))
    weights[:, 0] = 1
    joyful = REST[:, 0] > 5
    weights[joyful] = np.eye(4)[RIG.names.index("joy")]
    face = RIG.mixed(weights, contacts=False)
    expected = np.where(joyful[:, None], SHAPES["joy"], REST)
    np.testing.assert_allclose(face.vertices, expected, atol=1e-9)
    np.testing.assert_array_equal(face.weights, weights)


def test_offsets_are_added_to_the_mixed_face(rng: np.random.Generator) -> None:
    weights = np.tile(np.eye(4)[1], (len(REST), 1))
    offsets = rng.normal(size=REST.shape)
    face = RIG.mixed(weights, offsets, contacts=False)
    name = RIG.names[1]
    np.testing.assert_allclose(face.vertices, SHAPES[name] + offsets, atol=1e-9)


def test_bad_weights_by_vertex_are_refused() -> None:
    with pytest.raises(InputError, match="weights: expected shape"):
        RIG.mixed(np.ones((4, 4)))
    with pytest.raises(InputError, match="offsets: expected shape"):
        RIG.mixed(np.tile(np.eye(4)[1], (len(REST), 1)), np.zeros((3, 3)))


def test_turns_are_added_to_the_gaze_of_the_mixture() -> None:
    turn = np.array([[0.2, 0.05], [0.1, 0.0]])
    face = RIG.mixed(np.tile(only("joy"), (len(REST), 1)), turn=turn, contacts=False)
    expected = with_turned_eyes(SHAPES["joy"], turn, GENERIC)
    np.testing.assert_allclose(face.vertices, expected, atol=1e-9)
