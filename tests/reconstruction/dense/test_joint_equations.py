"""The eliminated equations against the whole system; their solution against its own cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from mien.arrays import Array
from mien.errors import EstimationError
from mien.reconstruction.dense.gauge import frame_motions
from mien.reconstruction.dense.joint import solve_jointly
from mien.reconstruction.dense.joint_equations import linearize, solve_rows
from mien.reconstruction.dense.joint_points import JointProblem, Rows, matching_noise, misfit_at
from mien.reconstruction.dense.joint_problem import CameraPrior, JointState, Lenses, start_state
from mien.reconstruction.dense.projection import UNKNOWNS
from sighted import Scene, sighted

SHARED = np.array([0, 1, 0])


def problem_of(scene: Scene) -> tuple[JointProblem, JointState]:
    """Two photos share a lens; the state is off, its places off their beliefs."""
    lenses = Lenses(SHARED, np.log([2500.0, 2800.0]), np.array([0.1, 0.2]))
    starts = scene.starts()
    state = start_state(starts, scene.prior.mean, lenses, len(scene.prior.components))
    believed = CameraPrior(state.R, state.t, lenses)
    rng = np.random.default_rng(1)
    common = 0.01 * rng.normal(size=18 + 2 + len(scene.prior.components))
    state = state.moved(common, rng.normal(size=state.places.shape))
    return JointProblem(starts, scene.sightings, scene.prior, believed), state


def whole_system(problem: JointProblem, state: JointState) -> tuple[Array, Array]:
    """Least squares over cameras, coefficients and places, nothing eliminated."""
    misfit, count = misfit_at(problem, state), len(state.places)
    photo, place = problem.seen.photo, problem.seen.place
    photos, lenses = len(state.R), len(state.log_focal)
    common = 6 * photos + lenses + len(state.coefficients)
    jacobian = np.zeros((2 * len(photo), common + 3 * count))
    by_camera = misfit.seen.by_camera()
    for m in range(len(photo)):
        rows = slice(2 * m, 2 * m + 2)
        jacobian[rows, 6 * photo[m] : 6 * photo[m] + 6] = by_camera[m, :, : UNKNOWNS - 1]
        jacobian[rows, 6 * photos + SHARED[photo[m]]] = by_camera[m, :, -1]
        first = common + 3 * place[m]
        jacobian[rows, first : first + 3] = misfit.seen.by_place[m]
    weights = np.repeat(misfit.weights, 2)
    off = np.zeros((3 * count, jacobian.shape[1]))
    off[:, 6 * photos + lenses : common], off[:, common:] = -problem.basis, np.eye(3 * count)
    precision = block_diag(*problem.prior.precision)
    alone = np.zeros(jacobian.shape[1])
    alone[:common] = np.append(problem.believed.precision, np.ones(len(state.coefficients)))
    matrix = jacobian.T @ (weights[:, None] * jacobian) + off.T @ precision @ off + np.diag(alone)
    gradient = jacobian.T @ (weights * misfit.residuals.ravel())
    gradient += off.T @ precision @ problem.deviations(state).ravel()
    gradient[:common] += alone[:common] * np.append(problem.believed.off(state), state.coefficients)
    return matrix, gradient


def test_elimination_agrees_with_the_whole_system() -> None:
    problem, state = problem_of(sighted(0, (-30, 0, 30), noise_px=0.5))
    rows, answer = linearize(problem, state, instruments=False)
    step = solve_rows(rows)
    matrix, gradient = whole_system(problem, state)
    whole = np.linalg.solve(matrix, -gradient)
    np.testing.assert_allclose(step, whole[: len(step)], rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(answer.step(step).ravel(), whole[len(step) :], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(rows.matrix, rows.matrix.T, rtol=1e-6, atol=1e-4)
    inverse = np.linalg.inv(matrix)[: len(step), : len(step)]
    np.testing.assert_allclose(np.linalg.inv(rows.matrix), inverse, rtol=1e-5, atol=1e-9)


def cost(problem: JointProblem, state: JointState, noise: float) -> float:
    """Whose weights are those of `misfit_at` while the matches' noise stays as it is."""
    squared = (misfit_at(problem, state).residuals ** 2).sum(axis=1)
    off, common = problem.deviations(state), problem.believed.off(state)
    return 0.5 * float(
        np.log(problem.seen.sigma_px**2 * noise**2 + squared).sum()
        + np.einsum("ni,nij,nj->", off, problem.prior.precision, off)
        + problem.believed.precision @ common**2
        + state.coefficients @ state.coefficients
    )


def test_no_small_change_costs_less_without_instruments() -> None:
    scene = sighted(3, (-30, 0, 30), noise_px=0.3)
    found = solve_jointly(
        scene.starts(), scene.prior.mean, scene.sightings, scene.prior, scene.lenses(0.05),
        instruments=False, iterations=300, tolerance=1e-9,
    )  # fmt: skip
    assert found.converged
    noise = matching_noise(found.off_sigmas)
    best = cost(found.problem, found.state, noise)
    count = len(linearize(found.problem, found.state)[0].right)
    for unknown in range(count + 6):
        for size in (-1e-4, 1e-4):
            step, places = np.zeros(count), np.zeros_like(scene.places)
            if unknown < count:
                step[unknown] = size
            else:
                places.flat[unknown - count] = size
            assert cost(found.problem, found.state.moved(step, places), noise) > best


def test_with_instruments_their_sums_vanish_but_for_the_frame() -> None:
    """What is left of them the images cannot tell from a motion of the frame."""
    scene = sighted(3, (-30, 0, 30), noise_px=0.3)
    found = solve_jointly(
        scene.starts(), scene.prior.mean, scene.sightings, scene.prior, scene.lenses(0.05),
        iterations=300, tolerance=1e-10,
    )  # fmt: skip
    problem, misfit = found.problem, misfit_at(found.problem, found.state)
    by_camera = misfit.seen.by_camera()
    at_mean = problem.project(found.state, scene.prior.mean).by_camera()
    weighted = np.swapaxes(misfit.weights[:, None, None] * by_camera, 1, 2)
    blocks = problem.believed.lenses.by_unknowns(problem.by_photo(weighted @ by_camera))
    felt = blocks + np.diag(problem.believed.precision)
    frame = felt @ frame_motions(found.state).of_cameras
    left = {}
    for name, instruments in (("mean", at_mean), ("estimate", by_camera)):
        each = (misfit.weights[:, None] * misfit.residuals)[..., None] * instruments
        sums = problem.believed.lenses.by_unknown(problem.by_photo(each.sum(axis=1)))
        sums += problem.believed.precision * problem.believed.off(found.state)
        # In units of the unknowns' own deviations.
        scale = 1 / np.sqrt(np.diagonal(felt))
        share = np.linalg.lstsq(scale[:, None] * frame, scale * sums)[0]
        left[name] = np.linalg.norm(scale * (sums - frame @ share))
    assert left["mean"] < 1e-5
    assert left["estimate"] > 100 * left["mean"]


def test_wrong_sightings_weigh_little() -> None:
    scene = sighted(0, (-30, 30))
    spoiled = scene.sightings.image_points.copy()
    spoiled[5] += 40
    problem = problem_at_truth(
        replace(scene, sightings=replace(scene.sightings, image_points=spoiled))
    )
    weights = misfit_at(*problem).weights
    assert weights[5] < 1e-4 * np.median(weights)


def test_matches_are_as_noisy_as_they_are() -> None:
    assert matching_noise(np.full(9, 0.2)) == 1
    assert matching_noise(np.append(np.full(9, 2.0), 900.0)) == pytest.approx(4)
    assert matching_noise(np.zeros(0)) == 1


def problem_at_truth(scene: Scene) -> tuple[JointProblem, JointState]:
    state = start_state(scene.cameras, scene.places, scene.lenses(), len(scene.coefficients))
    believed = CameraPrior(state.R, state.t, scene.lenses())
    return JointProblem(scene.cameras, scene.sightings, scene.prior, believed), state


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.full((2, 2), np.nan)])
def test_equations_without_a_solution(matrix: Array) -> None:
    with pytest.raises(EstimationError, match="do not determine cameras and shape"):
        solve_rows(Rows(matrix, np.ones(2)))
