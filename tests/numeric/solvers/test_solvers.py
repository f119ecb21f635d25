"""Anderson acceleration, Levenberg-Marquardt and the block solver, on problems solved otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError
from mien.numeric.solvers.anderson import AndersonAcceleration
from mien.numeric.solvers.levenberg_marquardt import minimize_lm
from mien.numeric.solvers.schur import BlockSystem


def test_anderson_solves_linear_maps_in_as_many_steps_as_unknowns(rng):
    size = 6
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    matrix = (basis * np.linspace(0.5, 0.99, size)) @ basis.T
    shift = rng.normal(size=size)
    truth = np.linalg.solve(np.eye(size) - matrix, shift)
    method, x = AndersonAcceleration(depth=10, regularization=0), np.zeros(size)
    for _ in range(size + 1):
        x = method.propose(x, matrix @ x + shift)
    np.testing.assert_allclose(x, truth, rtol=1e-6)


def test_anderson_without_history_is_the_plain_iteration(rng):
    method = AndersonAcceleration(depth=3)
    x, image = rng.normal(size=(2, 4))
    np.testing.assert_array_equal(method.propose(x, image), image)
    method.propose(image, image / 2)
    method.reset()
    np.testing.assert_array_equal(method.propose(x, image), image)


def rosenbrock(x):
    """Residuals of the banana valley; their minimum lies at (1, 1)."""
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def solve_rosenbrock(start, **options):
    def linearize(x):
        jacobian = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ rosenbrock(x)

        def solve(damping):
            extra = damping * np.diag(np.diag(normal))
            step = -np.linalg.solve(normal + extra, gradient)
            return step, 0.5 * step @ (extra @ step - gradient)

        return solve

    return minimize_lm(
        np.array(start),
        cost=lambda x: 0.5 * (rosenbrock(x) ** 2).sum(),
        linearize=linearize,
        move=lambda x, step: x + step,
        **options,
    )


def test_lm_follows_a_curved_valley():
    result = solve_rosenbrock([-1.2, 1.0])
    np.testing.assert_allclose(result.x, [1, 1], atol=1e-8)
    assert result.converged
    assert result.cost < 1e-15


def test_lm_reports_that_it_ran_out_of_iterations():
    result = solve_rosenbrock([-1.2, 1.0], max_iterations=3)
    assert not result.converged
    assert result.iterations == 3
    assert result.cost < 0.5 * (rosenbrock([-1.2, 1.0]) ** 2).sum()


@pytest.fixture
def system(rng):
    """Normal equations of a random block problem, and the same as one dense matrix."""
    common, count, size = 5, 7, 3
    jacobian = np.zeros((60, common + count * size))
    for row in range(60):
        block = common + size * (row % count)
        jacobian[row, :common] = rng.normal(size=common)
        jacobian[row, block : block + size] = rng.normal(size=size)
    residual = rng.normal(size=60)
    normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
    blocks = [slice(common + size * i, common + size * (i + 1)) for i in range(count)]
    return (
        BlockSystem(
            normal[:common, :common],
            np.stack([normal[b, b] for b in blocks]),
            np.stack([normal[:common, b] for b in blocks]),
            gradient[:common],
            np.stack([gradient[b] for b in blocks]),
        ),
        normal,
        gradient,
    )


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_block_solution_is_the_dense_solution(system, damping):
    blocks, normal, gradient = system
    damped = normal + damping * np.diag(np.diag(normal))
    expected = -np.linalg.solve(damped, gradient)
    common, points, fall = blocks.solve(damping)
    np.testing.assert_allclose(np.append(common, points.ravel()), expected, rtol=1e-9)
    quadratic = gradient @ expected + 0.5 * expected @ normal @ expected
    assert fall == pytest.approx(-quadratic)


def test_block_covariance_is_the_dense_inverse(system):
    blocks, normal, _ = system
    inverse = np.linalg.inv(normal)
    common, points = blocks.covariance()
    np.testing.assert_allclose(common, inverse[:5, :5], rtol=1e-8)
    np.testing.assert_allclose(points[2], inverse[11:14, 11:14], rtol=1e-8)


def test_constrained_covariance(system, rng):
    blocks, normal, _ = system
    constraints = rng.normal(size=(7, 2, 3))
    flat = np.hstack([np.zeros((2, 5)), np.swapaxes(constraints, 0, 1).reshape(2, -1)])
    free = np.linalg.svd(flat)[2][2:]
    expected = free.T @ np.linalg.inv(free @ normal @ free.T) @ free
    common, points = blocks.covariance(constraints)
    np.testing.assert_allclose(common, expected[:5, :5], rtol=1e-7)
    np.testing.assert_allclose(points[0], expected[5:8, 5:8], rtol=1e-7)


def test_a_block_without_data_is_infinitely_uncertain(system):
    blocks, _, _ = system
    blocks.blocks[3], blocks.coupling[3] = 0, 0
    assert np.isinf(blocks.covariance()[1][3]).all()
    assert list(np.flatnonzero(blocks.open_blocks())) == [3]


def test_covariance_of_undetermined_unknowns_is_refused(system):
    blocks, _, _ = system
    blocks.common[0], blocks.common[:, 0], blocks.coupling[:, 0] = 0, 0, 0
    with pytest.raises(EstimationError, match="not determined"):
        blocks.covariance()
