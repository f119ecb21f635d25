"""Levenberg-Marquardt on one size of a picture: the truth is found, and how well is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.arrays import Array
from mien.numeric.rotation import angle_between
from mien.track.parameters import Belief, Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import LIMIT, Answer, solve
from mien.track.photometric.linearization import Linearize, Scene, by_bands, by_plain_pictures
from mien.track.photometric.numeric_jacobian import by_differences

FACE = patterned.doing({"mouth": (0.6, 0.1), "eyes": (0.1, 0.4), "forehead": (0.2, 0.5)})
TRUTH = Guess(patterned.pose(), FACE)
COUNT = POSE_UNKNOWNS + len(FACE.vector)
MIXING = np.s_[POSE_UNKNOWNS : POSE_UNKNOWNS + FACE.alpha.size]
POSE = np.arange(COUNT) < POSE_UNKNOWNS - 1
BOTH = np.arange(COUNT) != POSE_UNKNOWNS - 1
WIDE = np.array([0.3] * 3 + [40.0, 40.0, 100.0, 0.3] + [1.0] * (COUNT - POSE_UNKNOWNS))
OFF = np.array([0.02, -0.02, 0.015, 1.5, -1, 5, 0, *[0.12, -0.1] * 3, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The truth, drawn exactly; linear around a face near by."""
    return patterned.scene(TRUTH, TRUTH.moved(OFF).face)


def solved(
    scene: Scene,
    start: Guess,
    linearized: Linearize = by_bands,
    *,
    free: Array = BOTH,
    deviations: Array = WIDE,
    mean: Guess | None = None,
) -> Answer:
    belief = Belief(mean or start, deviations)
    answer = solve(linearized(scene, start), belief, free=free, iterations=30, tolerance=1e-9)
    # What was drawn for a start that is far says less of where it leads than what is drawn there.
    for _ in range(3):
        look = linearized(scene, answer.guess)
        answer = solve(look, belief, free=free, iterations=30, tolerance=1e-9)
    return answer


def assert_truth(guess: Guess, *, degrees: float, mm: float, weights: float) -> None:
    assert np.degrees(angle_between(guess.pose.R, TRUTH.pose.R)) < degrees
    off = np.abs(guess.pose.t - TRUTH.pose.t)
    assert off[:2].max() < mm
    assert off[2] < 10 * mm
    assert np.abs(guess.face.alpha - TRUTH.face.alpha).max() < weights


@pytest.mark.parametrize("ways", ["analytic", "expressions by differences", "all by differences"])
def test_pose_and_face_are_found(scene: Scene, ways: str) -> None:
    numeric = np.arange(COUNT) >= {"analytic": COUNT, "all by differences": 0}.get(ways, 7)
    linearized = by_differences(numeric) if numeric.any() else by_bands
    answer = solved(scene, TRUTH.moved(OFF), linearized)
    assert_truth(answer.guess, degrees=0.05, mm=0.1, weights=0.02)
    assert answer.rms < 0.3
    assert answer.guess.pose.zoom == 1


def test_pose_alone_by_plain_pictures(scene: Scene) -> None:
    start = TRUTH.moved(np.where(POSE, OFF, 0))
    answer = solved(scene, start, by_plain_pictures, free=POSE)
    assert_truth(answer.guess, degrees=0.05, mm=0.1, weights=1e-9)
    np.testing.assert_array_equal(answer.guess.face.vector, start.face.vector)
    np.testing.assert_array_equal(answer.deviations[~POSE], WIDE[~POSE])


def test_nudged_from_its_optimum_the_residual_grows(scene: Scene) -> None:
    answer = solved(scene, TRUTH.moved(OFF))
    look = by_bands(scene, answer.guess)
    least = look.equations(answer.guess).squares
    for unknown in np.flatnonzero(BOTH)[: POSE_UNKNOWNS + 5]:
        step = np.zeros(COUNT)
        step[unknown] = 4 * answer.deviations[unknown]
        for moved in (step, -step):
            assert look.equations(answer.guess.moved(moved)).squares > least


def test_a_brighter_frame_changes_nothing(scene: Scene) -> None:
    brighter = replace(scene, target=scene.target + np.float32(25))
    answer = solved(brighter, TRUTH.moved(OFF))
    assert_truth(answer.guess, degrees=0.1, mm=0.2, weights=0.03)


def test_nothing_seen_leaves_what_was_believed(scene: Scene) -> None:
    blind = replace(scene, weights=np.zeros_like(scene.weights))
    answer = solved(blind, TRUTH.moved(OFF), mean=TRUTH)
    np.testing.assert_allclose(answer.guess.since(TRUTH), 0, atol=1e-5)
    np.testing.assert_allclose(answer.deviations, WIDE, rtol=1e-6)


def test_a_strong_belief_holds(scene: Scene) -> None:
    start = TRUTH.moved(OFF)
    answer = solved(scene, start, deviations=1e-5 * WIDE)
    assert np.abs(answer.guess.since(start) / WIDE).max() < 1e-3


def test_weights_out_of_range_are_held_back(scene: Scene) -> None:
    """[Pighin 2002]'s D(p) against a belief of deviation 1, both pulling at neutral."""
    blind = replace(scene, weights=np.zeros_like(scene.weights))
    mean = Guess(patterned.pose(), patterned.doing({"mouth": (1.4, 0.0)}))
    found = scene.model.basis.weights(solved(blind, mean).guess.face.alpha)
    assert found[0, 1] == pytest.approx(1 + 0.4 / (1 + 2 * LIMIT), abs=1e-4)
    np.testing.assert_allclose(found[1:, 0], 1, atol=1e-6)


def test_expressions_that_look_alike_are_not_told_apart() -> None:
    """Only their sum is: each by itself is about as uncertain as it was believed to be."""
    names, row = ("neutral", "joy", "twin"), (0.3, 0.2)
    face = patterned.doing(dict.fromkeys(("mouth", "eyes", "forehead"), row), names=names)
    truth = Guess(patterned.pose(), face)
    answer = solved(patterned.scene(truth, names=names), truth)
    alike = answer.deviations[MIXING].reshape(3, 2)
    usual = solved(patterned.scene(TRUTH), TRUTH).deviations[MIXING].reshape(3, 2)
    assert (alike > 0.4).all()
    assert (usual < 0.1).all()


def test_moved_and_since_are_inverse(rng: np.random.Generator) -> None:
    step = rng.normal(0, 0.1, COUNT)
    np.testing.assert_allclose(TRUTH.moved(step).since(TRUTH), step, atol=1e-9)
