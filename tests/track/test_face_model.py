"""The face that is linear around an anchor, beside the rig's own."""

from __future__ import annotations

import numpy as np
import pytest

import patterned
from mien.arrays import Array
from mien.errors import InputError
from mien.rig.basis import WEIGHT_RANGE
from mien.rig.state import FaceState, Gaze
from mien.track.face_model import FaceModel, FaceParameters, within_range
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS

MIXED = patterned.doing(
    {"mouth": (0.5, 0.2), "forehead": (0.1, 0.4)}, units=(0.2, 0.3), gaze=(0.1, -0.05)
)


@pytest.fixture
def model() -> FaceModel:
    return patterned.model()


def stepped(face: FaceParameters, unknown: int, step: float) -> FaceParameters:
    offsets = np.zeros(len(face.vector))
    offsets[unknown] = step
    return face.plus(offsets)


def test_layout(model: FaceModel) -> None:
    assert model.layout.regions == ("mouth", "eyes", "forehead")
    assert model.layout.expressions == patterned.NAMES
    assert model.layout.units == ("eyeBlinkLeft", "eyeBlinkRight")
    assert model.offsets.shape[0] == 3 * 2 + 2 + 2 == len(model.neutral.vector)


def test_neutral_is_the_head_as_photographed(model: FaceModel) -> None:
    weights = model.weights(model.neutral)
    np.testing.assert_allclose(weights, [[1, 0, 0]] * 3, atol=1e-12)
    vertices = model.anchored(model.neutral).face.vertices
    np.testing.assert_allclose(vertices, patterned.REST, atol=1e-9)


def test_at_its_anchor_it_is_the_rigs_own_face(model: FaceModel) -> None:
    state = FaceState(
        {"mouth": {"joy": 0.5, "anger": 0.2}, "forehead": {"joy": 0.1, "anger": 0.4}},
        {"eyeBlinkLeft": 0.2, "eyeBlinkRight": 0.3},
        Gaze(0.1, -0.05),
    )
    own, anchor = model.rig.evaluate(state), model.anchored(MIXED)
    found = model.posed(anchor, MIXED)
    np.testing.assert_allclose(found.vertices, own.vertices, atol=1e-9)
    np.testing.assert_allclose(found.weights, own.weights, atol=1e-9)
    np.testing.assert_allclose(found.brightness, own.brightness, atol=1e-12)


def test_parameters_must_be_finite(model: FaceModel) -> None:
    anchor = model.anchored(MIXED)
    with pytest.raises(InputError, match="parameters: expected finite numbers"):
        model.posed(anchor, stepped(MIXED, 3, np.nan))


@pytest.mark.parametrize("unknown", range(6))
def test_expressions_move_as_in_the_rig(model: FaceModel, unknown: int) -> None:
    """The rig differs where lids ride on the eyes and lips touch: there alone."""
    step = 0.05
    anchor = model.anchored(MIXED)
    ahead = model.posed(anchor, stepped(MIXED, unknown, step))
    true = model.anchored(stepped(MIXED, unknown, step)).face
    np.testing.assert_allclose(ahead.weights, true.weights, atol=1e-9)
    moved = np.linalg.norm(true.vertices - anchor.face.vertices, axis=1)
    off = np.linalg.norm(ahead.vertices - true.vertices, axis=1)
    assert moved.max() > 0.02
    assert np.quantile(off, 0.97) < 0.02 * moved.max()


@pytest.mark.parametrize(("unknown", "side"), [(6, "left"), (7, "right")])
def test_blinks_shut_their_own_eye(model: FaceModel, unknown: int, side: str) -> None:
    move = model.offsets[unknown]
    middle = patterned.GENERIC.vertex_of(f"{side}_upper_eyelid.3")
    other = "left" if side == "right" else "right"
    assert move[middle, 1] < -5
    assert np.abs(move[patterned.GENERIC.vertex_of(f"{other}_upper_eyelid.3")]).max() < 0.1
    blinks = [stepped(model.neutral, unknown, by) for by in (0.3, 0.4)]
    true = np.subtract(*[model.anchored(blink).face.vertices[middle] for blink in blinks])
    np.testing.assert_allclose(move[middle], true / -0.1, atol=1.5)


@pytest.mark.parametrize(("axis", "unknown"), [("yaw", 8), ("pitch", 9)])
def test_eyes_turn_as_in_the_rig(model: FaceModel, axis: str, unknown: int) -> None:
    """Positive yaw to the subject's left (x), positive pitch up (y)."""
    step, eyes = 0.05, patterned.GENERIC.mesh.vertices_of("left_eyeball", "right_eyeball")
    turned = [
        model.rig.evaluate(FaceState(gaze=Gaze(**{axis: by}))).vertices for by in (-step, step)
    ]
    rate = (turned[1] - turned[0])[eyes] / (2 * step)
    found = model.offsets[unknown][eyes]
    assert np.linalg.norm(found - rate, axis=1).max() < 0.05 * np.linalg.norm(rate, axis=1).max()
    front = eyes[patterned.REST[eyes, 2] > np.quantile(patterned.REST[eyes, 2], 0.95)]
    assert model.offsets[unknown][front, "xyz".index("x" if axis == "yaw" else "y")].min() > 5


def test_what_concerns_a_triangle(model: FaceModel) -> None:
    """Lists of unknowns hold the pose's everywhere, and all that moves or mixes a corner."""
    support = model.support
    rng = np.random.default_rng(3)
    for triangle in rng.integers(0, len(support.triangles), 200):
        row = support.set_of[triangle]
        active = support.sets[row, : support.sizes[row]]
        corners = support.triangles[triangle]
        assert set(range(POSE_UNKNOWNS)) <= set(active.tolist())
        moved = np.linalg.norm(model.offsets[:, corners], axis=2).max(axis=1) > 0.06
        assert set(POSE_UNKNOWNS + np.flatnonzero(moved)) <= set(active.tolist())
        mixed = support.masks[corners].max(axis=0) > 0
        own = [n for n in range(len(support.region)) if support.region[n] >= 0]
        assert all((n in active) >= mixed[support.region[n]] for n in own)


def test_weights_stay_in_range_without_changing_their_kind() -> None:
    def ranged(*row: float) -> Array:
        return within_range(np.array([row]))[0]

    np.testing.assert_allclose(ranged(0.2, 0.9, -0.1), [0.2, 0.9, -0.1], atol=1e-12)
    low, high = WEIGHT_RANGE
    for row in ((-2.0, 2.5, 0.5), (3.0, -1.0, -1.0), (0.0, -0.9, 1.9)):
        found = ranged(*row)
        assert found.sum() == pytest.approx(1)
        assert low - 1e-12 <= found.min()
        assert found.max() <= high + 1e-12
        # On the way from the mean to where it was.
        ratio = (found - 1 / 3) / (np.array(row) - 1 / 3)
        np.testing.assert_allclose(ratio, ratio[0])


def test_neutral_only() -> None:
    model = patterned.model(("neutral",))
    assert model.layout.weight_channels == ()
    assert "jawOpen" in model.layout.units
    assert not any(name.startswith("eyeLook") for name in model.layout.units)
    assert len(model.neutral.vector) == len(model.layout.units) + 2


def test_unknown_names() -> None:
    with pytest.raises(InputError, match="region"):
        FaceModel(patterned.head(), regions=("nose",))
    with pytest.raises(InputError, match=r"units.*wink"):
        FaceModel(patterned.head(), units=("wink",))
