"""Levenberg-Marquardt on one size of a picture: the truth is found, and how well is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.arrays import Array
from mien.numeric.rotation import angle_between
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import RANGE_PENALTY, LevelSolution, solve_level
from mien.track.photometric.linearization import (
    Linearizer,
    PyramidLevel,
    linearize_pose,
    linearize_pose_and_face,
)
from mien.track.photometric.numeric_jacobian import numeric_linearizer

FACE = patterned.doing({"mouth": (0.6, 0.1), "eyes": (0.1, 0.4), "forehead": (0.2, 0.5)})
TRUTH = Parameters(patterned.pose(), FACE)
COUNT = POSE_UNKNOWNS + len(FACE.vector)
MIXING = np.s_[POSE_UNKNOWNS : POSE_UNKNOWNS + FACE.alpha.size]
POSE = np.arange(COUNT) < POSE_UNKNOWNS - 1
BOTH = np.arange(COUNT) != POSE_UNKNOWNS - 1
WIDE = np.array([0.3] * 3 + [40.0, 40.0, 100.0, 0.3] + [1.0] * (COUNT - POSE_UNKNOWNS))
OFF = np.array([0.02, -0.02, 0.015, 1.5, -1, 5, 0, *[0.12, -0.1] * 3, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def level() -> PyramidLevel:
    """The truth, drawn exactly; linear around a face near by."""
    return patterned.level(TRUTH, TRUTH.plus(OFF).face)


def solved(
    level: PyramidLevel,
    start: Parameters,
    linearized: Linearizer = linearize_pose_and_face,
    *,
    free: Array = BOTH,
    deviations: Array = WIDE,
    mean: Parameters | None = None,
) -> LevelSolution:
    prior = GaussianPrior(mean or start, deviations)
    solution = solve_level(
        linearized(level, start), prior, free=free, iterations=30, tolerance=1e-9
    )
    # What was drawn for a start that is far says less of where it leads than what is drawn there.
    for _ in range(3):
        linearization = linearized(level, solution.parameters)
        solution = solve_level(linearization, prior, free=free, iterations=30, tolerance=1e-9)
    return solution


def assert_truth(parameters: Parameters, *, degrees: float, mm: float, weights: float) -> None:
    assert np.degrees(angle_between(parameters.pose.R, TRUTH.pose.R)) < degrees
    off = np.abs(parameters.pose.t - TRUTH.pose.t)
    assert off[:2].max() < mm
    assert off[2] < 10 * mm
    assert np.abs(parameters.face.alpha - TRUTH.face.alpha).max() < weights


@pytest.mark.parametrize("ways", ["analytic", "expressions by differences", "all by differences"])
def test_pose_and_face_are_found(level: PyramidLevel, ways: str) -> None:
    numeric = np.arange(COUNT) >= {"analytic": COUNT, "all by differences": 0}.get(ways, 7)
    linearized = numeric_linearizer(numeric) if numeric.any() else linearize_pose_and_face
    solution = solved(level, TRUTH.plus(OFF), linearized)
    assert_truth(solution.parameters, degrees=0.05, mm=0.1, weights=0.02)
    assert solution.rms < 0.3
    assert solution.parameters.pose.zoom == 1


def test_pose_alone_by_plain_pictures(level: PyramidLevel) -> None:
    start = TRUTH.plus(np.where(POSE, OFF, 0))
    solution = solved(level, start, linearize_pose, free=POSE)
    assert_truth(solution.parameters, degrees=0.05, mm=0.1, weights=1e-9)
    np.testing.assert_array_equal(solution.parameters.face.vector, start.face.vector)
    np.testing.assert_array_equal(solution.deviations[~POSE], WIDE[~POSE])


def test_nudged_from_its_optimum_the_residual_grows(level: PyramidLevel) -> None:
    solution = solved(level, TRUTH.plus(OFF))
    linearization = linearize_pose_and_face(level, solution.parameters)
    least = linearization.normal_equations(solution.parameters).squares
    for unknown in np.flatnonzero(BOTH)[: POSE_UNKNOWNS + 5]:
        step = np.zeros(COUNT)
        step[unknown] = 4 * solution.deviations[unknown]
        for moved in (step, -step):
            assert linearization.normal_equations(solution.parameters.plus(moved)).squares > least


def test_a_brighter_frame_changes_nothing(level: PyramidLevel) -> None:
    brighter = replace(level, target=level.target + np.float32(25))
    solution = solved(brighter, TRUTH.plus(OFF))
    assert_truth(solution.parameters, degrees=0.1, mm=0.2, weights=0.03)


def test_nothing_seen_leaves_what_was_believed(level: PyramidLevel) -> None:
    blind = replace(level, weights=np.zeros_like(level.weights))
    solution = solved(blind, TRUTH.plus(OFF), mean=TRUTH)
    np.testing.assert_allclose(solution.parameters.minus(TRUTH), 0, atol=1e-5)
    np.testing.assert_allclose(solution.deviations, WIDE, rtol=1e-6)


def test_a_strong_belief_holds(level: PyramidLevel) -> None:
    start = TRUTH.plus(OFF)
    solution = solved(level, start, deviations=1e-5 * WIDE)
    assert np.abs(solution.parameters.minus(start) / WIDE).max() < 1e-3


def test_weights_out_of_range_are_held_back(level: PyramidLevel) -> None:
    """[Pighin 2002]'s D(p) against a belief of deviation 1, both pulling at neutral."""
    blind = replace(level, weights=np.zeros_like(level.weights))
    mean = Parameters(patterned.pose(), patterned.doing({"mouth": (1.4, 0.0)}))
    found = level.model.basis.weights(solved(blind, mean).parameters.face.alpha)
    assert found[0, 1] == pytest.approx(1 + 0.4 / (1 + 2 * RANGE_PENALTY), abs=1e-4)
    np.testing.assert_allclose(found[1:, 0], 1, atol=1e-6)


def test_expressions_that_look_alike_are_not_told_apart() -> None:
    """Only their sum is: each by itself is about as uncertain as it was believed to be."""
    names, row = ("neutral", "joy", "twin"), (0.3, 0.2)
    face = patterned.doing(dict.fromkeys(("mouth", "eyes", "forehead"), row), names=names)
    truth = Parameters(patterned.pose(), face)
    solution = solved(patterned.level(truth, names=names), truth)
    alike = solution.deviations[MIXING].reshape(3, 2)
    usual = solved(patterned.level(TRUTH), TRUTH).deviations[MIXING].reshape(3, 2)
    assert (alike > 0.4).all()
    assert (usual < 0.1).all()


def test_moved_and_since_are_inverse(rng: np.random.Generator) -> None:
    step = rng.normal(0, 0.1, COUNT)
    np.testing.assert_allclose(TRUTH.plus(step).minus(TRUTH), step, atol=1e-9)
