"""Some columns of the Jacobian by differences, the others analytic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.errors import InputError
from mien.track.parameters import Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.linearization import Scene
from mien.track.photometric.numeric_jacobian import by_differences, unknowns_named
from mien.track.state import Layout

LAYOUT = Layout(("mouth", "eyes"), ("neutral", "joy", "anger"), ("eyeBlinkLeft",))
FACE = patterned.doing({"mouth": (0.4, 0.1), "eyes": (0.0, 0.5)}, units=(0.3, 0.4))
TRUTH = Guess(patterned.pose(), FACE)
COUNT = POSE_UNKNOWNS + len(TRUTH.face.vector)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return patterned.scene(TRUTH)


@pytest.fixture(scope="module")
def guess() -> Guess:
    """Near the truth."""
    deviations = [0.004] * 3 + [0.6, 0.6, 3, 0.002] + [0.05] * (COUNT - POSE_UNKNOWNS)
    return TRUTH.moved(np.random.default_rng(4).normal(0, deviations))


@pytest.mark.parametrize("plain", [True, False])
def test_every_column_is_either_one_or_the_other(scene: Scene, guess: Guess, plain: bool) -> None:
    """Products of two unknowns depend on how these two are computed alone."""
    half = np.arange(COUNT) % 2 == 0
    of = {
        name: by_differences(numeric, plain=plain)(scene, guess).equations(guess)
        for name, numeric in {
            "half": half,
            "all": np.ones(COUNT, bool),
            "none": np.zeros(COUNT, bool),
        }.items()
    }
    for chosen, name in ((half, "all"), (~half, "none")):
        own, other = (of[key].matrix[np.ix_(chosen, chosen)] for key in ("half", name))
        np.testing.assert_allclose(own, other, rtol=1e-3, atol=1e-4 * np.abs(other).max())
        gap = (of["half"].vector - of[name].vector)[chosen]
        assert np.abs(gap).max() < 1e-3 * np.abs(of[name].vector).max()
    assert of["half"].squares == pytest.approx(of["none"].squares)
    np.testing.assert_array_equal(of["half"].matrix, of["half"].matrix.T)


def test_pictures_are_those_of_the_guess(scene: Scene, guess: Guess) -> None:
    look = by_differences(np.ones(COUNT, bool))(scene, TRUTH)
    np.testing.assert_array_equal(look.pictures(guess).drawn, scene.draw(guess, layers=True).luma)


def test_exact_is_the_rigs_own_face(scene: Scene, guess: Guess) -> None:
    """Wherever the scene is linear around."""
    found = by_differences(np.zeros(COUNT, bool), exact=True)(scene, TRUTH).pictures(guess)
    own = replace(scene, anchor=scene.model.anchored(guess.face)).draw(guess, layers=False)
    np.testing.assert_array_equal(found.drawn, own.luma)


def test_steps_from_the_truth_cancel(scene: Scene) -> None:
    found = by_differences(np.ones(COUNT, bool))(scene, TRUTH).equations(TRUTH)
    assert found.squares == pytest.approx(0, abs=1e-3)
    lengths = np.sqrt(np.diag(found.matrix))
    np.testing.assert_allclose(found.vector / lengths, 0, atol=1e-3)


def test_a_head_without_expressions() -> None:
    """Units and gaze alone: nothing is mixed but by what is numeric."""
    names = ("neutral",)
    model = patterned.model(names)
    truth = Guess(patterned.pose(), model.neutral)
    scene = patterned.scene(truth, names=names)
    numeric = unknowns_named(model.layout, ("pose", "browInnerUp"))
    step = np.zeros(len(numeric))
    step[POSE_UNKNOWNS + model.layout.units.index("browInnerUp")] = 0.1
    start = truth.moved(step)
    found = by_differences(numeric)(scene, start).equations(start)
    back = found.vector @ step / (step @ found.matrix @ step)
    assert back == pytest.approx(-1, abs=0.2)


def test_names() -> None:
    count = POSE_UNKNOWNS + 2 * 2 + 1 + 2
    assert unknowns_named(LAYOUT, ()).tolist() == [False] * count
    places = {
        "pose": range(7),
        "mouth": (7, 8),
        "eyes": (9, 10),
        "eyeBlinkLeft": (11,),
        "gaze": (12, 13),
    }
    for name, expected in places.items():
        np.testing.assert_array_equal(np.flatnonzero(unknowns_named(LAYOUT, (name,))), expected)
    assert unknowns_named(LAYOUT, tuple(places)).all()


def test_unknown_names() -> None:
    with pytest.raises(InputError, match=r"numeric: expected some of pose, mouth.*nose"):
        unknowns_named(LAYOUT, ("mouth", "nose"))
