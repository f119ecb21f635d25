"""Robust losses."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.numeric.solvers.robust import LOSSES, loss_named, robust_sigma


@pytest.mark.parametrize("name", LOSSES)
def test_weight_is_the_derivative_of_the_loss(name):
    u = np.array([1e-3, 0.5, 1.5, 3.0, 10.0, 1e4])
    step = 1e-5 * u
    loss = loss_named(name)
    numeric = (loss(u + step)[0] - loss(u - step)[0]) / (2 * step)
    np.testing.assert_allclose(loss(u)[1], numeric, rtol=1e-4)


@pytest.mark.parametrize("name", LOSSES)
def test_small_residuals_count_in_full(name):
    value, weight = loss_named(name)(np.array([0.0, 1e-9]))
    np.testing.assert_allclose(value, [0, 1e-9], atol=1e-15)
    np.testing.assert_allclose(weight, 1)


def test_unknown_loss():
    with pytest.raises(InputError, match="loss: expected linear or huber or cauchy, got tukey"):
        loss_named("tukey")


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_sigma_of_normal_residuals(rng, dimensions):
    lengths = np.linalg.norm(2.5 * rng.normal(size=(20000, dimensions)), axis=1)
    lengths[:200] = 1e6
    assert robust_sigma(lengths, dimensions) == pytest.approx(2.5, rel=0.05)
