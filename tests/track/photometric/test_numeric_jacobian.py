"""Some columns of the Jacobian by differences, the others analytic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.errors import InputError
from mien.track.parameters import Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.linearization import PyramidLevel
from mien.track.photometric.numeric_jacobian import numeric_linearizer, select_unknowns
from mien.track.state import Layout

LAYOUT = Layout(("mouth", "eyes"), ("neutral", "joy", "anger"), ("eyeBlinkLeft",))
FACE = patterned.doing({"mouth": (0.4, 0.1), "eyes": (0.0, 0.5)}, units=(0.3, 0.4))
TRUTH = Parameters(patterned.pose(), FACE)
COUNT = POSE_UNKNOWNS + len(TRUTH.face.vector)


@pytest.fixture(scope="module")
def level() -> PyramidLevel:
    return patterned.level(TRUTH)


@pytest.fixture(scope="module")
def parameters() -> Parameters:
    """Near the truth."""
    deviations = [0.004] * 3 + [0.6, 0.6, 3, 0.002] + [0.05] * (COUNT - POSE_UNKNOWNS)
    return TRUTH.plus(np.random.default_rng(4).normal(0, deviations))


@pytest.mark.parametrize("plain", [True, False])
def test_every_column_is_either_one_or_the_other(
    level: PyramidLevel, parameters: Parameters, plain: bool
) -> None:
    """Products of two unknowns depend on how these two are computed alone."""
    half = np.arange(COUNT) % 2 == 0
    of = {
        name: numeric_linearizer(numeric, plain=plain)(level, parameters).normal_equations(
            parameters
        )
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


def test_pictures_are_those_of_the_guess(level: PyramidLevel, parameters: Parameters) -> None:
    linearization = numeric_linearizer(np.ones(COUNT, bool))(level, TRUTH)
    np.testing.assert_array_equal(
        linearization.image_pair(parameters).drawn, level.draw(parameters, layers=True).luma
    )


def test_exact_is_the_rigs_own_face(level: PyramidLevel, parameters: Parameters) -> None:
    """Wherever the scene is linear around."""
    found = numeric_linearizer(np.zeros(COUNT, bool), exact=True)(level, TRUTH).image_pair(
        parameters
    )
    own = replace(level, anchor=level.model.anchored(parameters.face)).draw(
        parameters, layers=False
    )
    np.testing.assert_array_equal(found.drawn, own.luma)


def test_steps_from_the_truth_cancel(level: PyramidLevel) -> None:
    found = numeric_linearizer(np.ones(COUNT, bool))(level, TRUTH).normal_equations(TRUTH)
    assert found.squares == pytest.approx(0, abs=1e-3)
    lengths = np.sqrt(np.diag(found.matrix))
    np.testing.assert_allclose(found.vector / lengths, 0, atol=1e-3)


def test_a_head_without_expressions() -> None:
    """Units and gaze alone: nothing is mixed but by what is numeric."""
    names = ("neutral",)
    model = patterned.model(names)
    truth = Parameters(patterned.pose(), model.neutral)
    level = patterned.level(truth, names=names)
    numeric = select_unknowns(model.layout, ("pose", "browInnerUp"))
    step = np.zeros(len(numeric))
    step[POSE_UNKNOWNS + model.layout.units.index("browInnerUp")] = 0.1
    start = truth.plus(step)
    found = numeric_linearizer(numeric)(level, start).normal_equations(start)
    back = found.vector @ step / (step @ found.matrix @ step)
    assert back == pytest.approx(-1, abs=0.2)


def test_names() -> None:
    count = POSE_UNKNOWNS + 2 * 2 + 1 + 2
    assert select_unknowns(LAYOUT, ()).tolist() == [False] * count
    positions = {
        "pose": range(7),
        "mouth": (7, 8),
        "eyes": (9, 10),
        "eyeBlinkLeft": (11,),
        "gaze": (12, 13),
    }
    for name, expected in positions.items():
        np.testing.assert_array_equal(np.flatnonzero(select_unknowns(LAYOUT, (name,))), expected)
    assert select_unknowns(LAYOUT, tuple(positions)).all()


def test_unknown_names() -> None:
    with pytest.raises(InputError, match=r"numeric: expected some of pose, mouth.*nose"):
        select_unknowns(LAYOUT, ("mouth", "nose"))
