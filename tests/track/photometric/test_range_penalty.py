"""D(p): [Pighin 2002]'s formula, and its derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.rig.basis import Basis
from mien.track.photometric.range_penalty import range_penalty

C = 7.0


def test_in_range_there_is_none() -> None:
    assert range_penalty(np.array([0.0, 0.3, 1.0]), C, np.eye(3)) is None
    assert range_penalty(np.empty(0), C, np.empty((0, 0))) is None


@pytest.mark.parametrize(
    ("weights", "value"),
    [((-0.2, 0.5, 0.7), 0.04), ((0, 0, 1.3), 0.09), ((-0.1, -0.3, 1.4), 0.26)],
)
def test_grows_with_the_square_of_what_is_out_of_range(
    weights: tuple[float, ...], value: float
) -> None:
    found = range_penalty(np.array(weights), C, np.eye(3))
    assert found is not None
    assert found.value == pytest.approx(C * value)


def test_derivatives_are_those_of_differences(rng: np.random.Generator) -> None:
    basis = Basis.by_gram_schmidt(4)
    alpha, step = rng.normal(0, 0.8, 3), 1e-5

    def at(moved: Array) -> Array:
        found = range_penalty(basis.weights(moved), C, basis.Q)
        assert found is not None
        return np.array([found.value, *found.gradient])

    found = range_penalty(basis.weights(alpha), C, basis.Q)
    assert found is not None
    ends = [(at(alpha + step * e), at(alpha - step * e)) for e in np.eye(3)]
    changes = np.array([ahead - behind for ahead, behind in ends]) / (2 * step)
    np.testing.assert_allclose(found.gradient, changes[:, 0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.hessian, changes[:, 1:], rtol=1e-6, atol=1e-6)
    assert np.linalg.eigvalsh(found.hessian).min() > -1e-9
