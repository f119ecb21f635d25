"""Steps told from noise: how much of them is taken, and where."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.photometric.shrinkage import MIN_GAIN, ParameterBlock, shrink_step

CLEAR = 8.0


def block(*unknowns: int, clear: float = CLEAR) -> ParameterBlock:
    return ParameterBlock(np.array(unknowns), np.ones(len(unknowns)), clear)


def covariance(rng: np.random.Generator, count: int) -> Array:
    roots = rng.normal(size=(count, count))
    return roots @ roots.T + 0.1 * np.eye(count)


def test_still_state_trembles_by_the_stated_factor_of_the_noise() -> None:
    rng = np.random.default_rng(0)
    noise = covariance(rng, 6)
    roots, information = np.linalg.cholesky(noise), np.linalg.inv(noise)
    state, states = np.zeros(6), []
    for _ in range(3000):
        state = state + shrink_step(
            roots @ rng.normal(size=6) - state, information, [block(*range(6))]
        )
        states.append(state)
    factor = np.cov(np.array(states[100:]).T).trace() / noise.trace()
    assert factor == pytest.approx(MIN_GAIN / (2 - MIN_GAIN), rel=0.15)


def test_clear_motion_passes_at_once() -> None:
    step = np.array([0.0, 40.0, 0.0])
    taken = shrink_step(step, np.eye(3), [block(0, 1, 2)])
    np.testing.assert_allclose(taken, step, atol=0.1)


def test_a_block_that_moves_clearly_moves_in_every_direction() -> None:
    step = np.array([100.0, 1.0, 0.0])
    taken = shrink_step(step, np.eye(3), [block(0, 1, 2)])
    np.testing.assert_allclose(taken, step, rtol=0.01)


def test_directions_of_a_block_are_apart_while_it_is_nearly_still() -> None:
    """A shift that is well known is taken, a turn that is not stays, though told from it badly."""
    information = np.diag([100.0, 1.0])
    taken = shrink_step(np.array([1.2, 0.5]), information, [block(0, 1)])
    assert taken[0] > 0.8
    assert taken[1] < 0.3


def test_blocks_do_not_disturb_each_other() -> None:
    step = np.array([50.0, 50.0, 0.5, -0.3])
    taken = shrink_step(step, np.eye(4), [block(0, 1), block(2, 3)])
    alone = shrink_step(step[2:], np.eye(2), [block(0, 1)])
    np.testing.assert_allclose(taken[2:], alone)
    np.testing.assert_allclose(taken[:2], step[:2], rtol=1e-2)


def test_what_is_in_no_block_is_free_and_follows_what_holds_still() -> None:
    information = np.array([[2.0, 1.0], [1.0, 1.0]])
    step = np.array([0.1, 0.1])
    taken = shrink_step(step, information, [block(0)])
    assert 0 < taken[0] < 0.02
    # The likeliest of the second, given the first: its conditional mean.
    assert taken[1] == pytest.approx(step[1] - (taken[0] - step[0]))
    np.testing.assert_allclose(shrink_step(step, information, []), step)


def test_lag_behind_a_ramp_is_bounded_and_goes_with_speed() -> None:
    """In deviations of one frame: at most 0.57 * 0.85 * clear, whatever the speed."""
    for speed in (0.1, 1.0, 3.0, 10.0, 30.0):
        lag = 0.0
        for _ in range(200):
            solution = np.array([lag + speed])
            lag = float(solution[0] - shrink_step(solution, np.eye(1), [block(0)])[0])
        assert lag < 0.57 * (1 - MIN_GAIN) * CLEAR
    assert lag < 0.1


def test_nothing_moves_without_a_step() -> None:
    empty = ParameterBlock(np.empty(0, int), np.empty(0), CLEAR)
    np.testing.assert_array_equal(shrink_step(np.zeros(2), np.eye(2), [empty, block(0, 1)]), 0)
