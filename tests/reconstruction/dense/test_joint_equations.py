"""The eliminated equations against the whole system; their solution against its own cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from mien.arrays import Array
from mien.errors import EstimationError
from mien.reconstruction.bundle.gauge import gauge_motions
from mien.reconstruction.bundle.problem import BundleProblem, BundleState, CameraPrior, FocalGroups
from mien.reconstruction.bundle.projection import CAMERA_SIZE
from mien.reconstruction.dense.joint import (
    POSE_DEVIATION,
    noise_factor,
    reprojection,
    solve_equations,
    solve_jointly,
)
from observed import Scene, observed

SHARED = np.array([0, 1, 0])


def problem_of(scene: Scene) -> tuple[BundleProblem, BundleState]:
    """Two photos share a lens; the state is off, its points off their prior."""
    lenses = FocalGroups(SHARED, np.log([2500.0, 2800.0]), np.array([0.1, 0.2]))
    starts = scene.starts()
    components = len(scene.prior.components)
    state = BundleState.of(starts, scene.prior.mean, lenses.group, components)
    believed = CameraPrior(state.R, state.t, lenses, POSE_DEVIATION)
    rng = np.random.default_rng(1)
    common = 0.01 * rng.normal(size=18 + 2 + len(scene.prior.components))
    state = state.moved(common, rng.normal(size=state.points.shape))
    return BundleProblem(starts, scene.observations, scene.prior, believed), state


def whole_system(problem: BundleProblem, state: BundleState) -> tuple[Array, Array]:
    """Least squares over cameras, coefficients and points, nothing eliminated."""
    misfit, count = reprojection(problem, state), len(state.points)
    photo, point = problem.observations.photo, problem.observations.point
    photos, lenses = len(state.R), len(state.log_focal)
    common = 6 * photos + lenses + len(state.coefficients)
    jacobian = np.zeros((2 * len(photo), common + 3 * count))
    by_camera = misfit.projection.camera_jacobian()
    for m in range(len(photo)):
        rows = slice(2 * m, 2 * m + 2)
        jacobian[rows, 6 * photo[m] : 6 * photo[m] + 6] = by_camera[m, :, : CAMERA_SIZE - 1]
        jacobian[rows, 6 * photos + SHARED[photo[m]]] = by_camera[m, :, -1]
        first = common + 3 * point[m]
        jacobian[rows, first : first + 3] = misfit.projection.point_jacobian[m]
    weights = np.repeat(misfit.weights, 2)
    off = np.zeros((3 * count, jacobian.shape[1]))
    off[:, 6 * photos + lenses : common], off[:, common:] = -problem.basis, np.eye(3 * count)
    precision = block_diag(*problem.point_prior.precision)
    alone = np.zeros(jacobian.shape[1])
    alone[:common] = np.append(problem.camera_prior.precision, np.ones(len(state.coefficients)))
    matrix = jacobian.T @ (weights[:, None] * jacobian) + off.T @ precision @ off + np.diag(alone)
    gradient = jacobian.T @ (weights * misfit.residuals.ravel())
    gradient += off.T @ precision @ problem.point_deviations(state).ravel()
    gradient[:common] += alone[:common] * np.append(
        problem.camera_prior.deviations(state), state.coefficients
    )
    return matrix, gradient


def test_elimination_agrees_with_the_whole_system() -> None:
    problem, state = problem_of(observed(0, (-30, 0, 30), noise_px=0.5))
    system = problem.normal_equations(state, reprojection(problem, state))
    reduced, right = system.reduced()
    step = solve_equations(reduced, right)
    matrix, gradient = whole_system(problem, state)
    whole = np.linalg.solve(matrix, -gradient)
    np.testing.assert_allclose(step, whole[: len(step)], rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(
        system.block_step(step).ravel(), whole[len(step) :], rtol=1e-6, atol=1e-8
    )
    np.testing.assert_allclose(reduced, reduced.T, rtol=1e-6, atol=1e-4)
    inverse = np.linalg.inv(matrix)[: len(step), : len(step)]
    np.testing.assert_allclose(np.linalg.inv(reduced), inverse, rtol=1e-5, atol=1e-9)


def cost(problem: BundleProblem, state: BundleState, noise: float) -> float:
    """Whose weights are those of `reprojection` while the matches' noise stays as it is."""
    squared = (reprojection(problem, state).residuals ** 2).sum(axis=1)
    off, common = problem.point_deviations(state), problem.camera_prior.deviations(state)
    return 0.5 * float(
        np.log(problem.observations.sigma_px**2 * noise**2 + squared).sum()
        + np.einsum("ni,nij,nj->", off, problem.point_prior.precision, off)
        + problem.camera_prior.precision @ common**2
        + state.coefficients @ state.coefficients
    )


def test_no_small_change_costs_less_without_instruments() -> None:
    scene = observed(3, (-30, 0, 30), noise_px=0.3)
    found = solve_jointly(
        scene.starts(), scene.prior.mean, scene.observations, scene.prior, scene.focal(0.05),
        instruments=False, iterations=300, tolerance=1e-9,
    )  # fmt: skip
    assert found.converged
    noise = noise_factor(found.normalized_residuals)
    best = cost(found.problem, found.state, noise)
    count = len(found.covariance)
    for unknown in range(count + 6):
        for size in (-1e-4, 1e-4):
            step, points = np.zeros(count), np.zeros_like(scene.points)
            if unknown < count:
                step[unknown] = size
            else:
                points.flat[unknown - count] = size
            assert cost(found.problem, found.state.moved(step, points), noise) > best


def test_with_instruments_their_sums_vanish_but_for_the_frame() -> None:
    """What is left of them the images cannot tell from a motion of the frame."""
    scene = observed(3, (-30, 0, 30), noise_px=0.3)
    found = solve_jointly(
        scene.starts(), scene.prior.mean, scene.observations, scene.prior, scene.focal(0.05),
        iterations=300, tolerance=1e-10,
    )  # fmt: skip
    problem, misfit = found.problem, reprojection(found.problem, found.state)
    by_camera = misfit.projection.camera_jacobian()
    at_mean = problem.project(found.state, scene.prior.mean).camera_jacobian()
    weighted = np.swapaxes(misfit.weights[:, None, None] * by_camera, 1, 2)
    blocks = problem.camera_prior.focal.join_blocks(problem.sum_by_photo(weighted @ by_camera))
    felt = blocks + np.diag(problem.camera_prior.precision)
    frame = felt @ gauge_motions(found.state).cameras
    left = {}
    for name, instruments in (("mean", at_mean), ("estimate", by_camera)):
        each = (misfit.weights[:, None] * misfit.residuals)[..., None] * instruments
        sums = problem.camera_prior.focal.sum_by_unknown(problem.sum_by_photo(each.sum(axis=1)))
        sums += problem.camera_prior.precision * problem.camera_prior.deviations(found.state)
        # In units of the unknowns' own deviations.
        scale = 1 / np.sqrt(np.diagonal(felt))
        share = np.linalg.lstsq(scale[:, None] * frame, scale * sums)[0]
        left[name] = np.linalg.norm(scale * (sums - frame @ share))
    assert left["mean"] < 1e-5
    assert left["estimate"] > 100 * left["mean"]


def test_wrong_observations_weigh_little() -> None:
    scene = observed(0, (-30, 30))
    spoiled = scene.observations.image_points.copy()
    spoiled[5] += 40
    problem = problem_at_truth(
        replace(scene, observations=replace(scene.observations, image_points=spoiled))
    )
    weights = reprojection(*problem).weights
    assert weights[5] < 1e-4 * np.median(weights)


def test_matches_are_as_noisy_as_they_are() -> None:
    assert noise_factor(np.full(9, 0.2)) == 1
    assert noise_factor(np.append(np.full(9, 2.0), 900.0)) == pytest.approx(4)
    assert noise_factor(np.zeros(0)) == 1


def problem_at_truth(scene: Scene) -> tuple[BundleProblem, BundleState]:
    group = scene.focal().group
    state = BundleState.of(scene.cameras, scene.points, group, len(scene.coefficients))
    believed = CameraPrior(state.R, state.t, scene.focal(), POSE_DEVIATION)
    return BundleProblem(scene.cameras, scene.observations, scene.prior, believed), state


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.full((2, 2), np.nan)])
def test_equations_without_a_solution(matrix: Array) -> None:
    with pytest.raises(EstimationError, match="do not determine cameras and shape"):
        solve_equations(matrix, np.ones(2))
