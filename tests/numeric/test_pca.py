"""Principal components."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.numeric.pca import fit_pca


def rows_of_rank(rng, rank, *, count=40, width=12, mean=5.0):
    return mean + rng.normal(size=(count, rank)) @ rng.normal(size=(rank, width))


def test_components_are_orthonormal_and_sorted(rng):
    pca = fit_pca(rng.normal(size=(40, 12)) * np.arange(1, 13), 5)
    np.testing.assert_allclose(pca.components @ pca.components.T, np.eye(5), atol=1e-12)
    assert (np.diff(pca.deviations) < 0).all()


def test_rows_in_the_subspace_are_their_own_projection(rng):
    rows = rows_of_rank(rng, 3)
    pca = fit_pca(rows, 3)
    np.testing.assert_allclose(pca.project(rows), rows, atol=1e-10)
    assert pca.residual == pytest.approx(0, abs=1e-10)


def test_no_other_point_of_the_subspace_is_nearer(rng):
    pca = fit_pca(rng.normal(size=(40, 12)), 4)
    row = rng.normal(size=12)
    away = row - pca.project(row)
    np.testing.assert_allclose(pca.components @ away, 0, atol=1e-12)
    np.testing.assert_allclose(pca.project(pca.project(row)), pca.project(row))


def test_variance_is_all_accounted_for(rng):
    rows = rng.normal(size=(60, 9)) * np.arange(1, 10)
    pca = fit_pca(rows, 4)
    total = rows.var(axis=0, ddof=1).sum()
    assert (pca.deviations**2).sum() + 5 * pca.residual**2 == pytest.approx(total)


def test_deviations_are_those_along_the_components(rng):
    rows = rng.normal(size=(60, 9)) * np.arange(1, 10)
    pca = fit_pca(rows, 4)
    np.testing.assert_allclose(pca.coefficients(rows).std(axis=0, ddof=1), pca.deviations)


def test_no_more_components_than_the_rows_span(rng):
    assert len(fit_pca(rows_of_rank(rng, 3), 8).components) == 3
    assert len(fit_pca(np.full((4, 6), 2.0), 8).components) == 0


def test_about_zero_the_subspace_contains_zero(rng):
    rows = rows_of_rank(rng, 3)
    pca = fit_pca(rows, 4, centred=False)
    np.testing.assert_array_equal(pca.project(np.zeros(12)), 0)
    np.testing.assert_allclose(pca.project(rows), rows, atol=1e-10)


@pytest.mark.parametrize(
    ("rows", "components", "message"),
    [
        (np.full((3, 2), np.nan), 1, "rows: expected finite numbers"),
        (np.zeros(4), 1, "rows: expected shape"),
        (np.zeros((1, 4)), 1, "rows: expected at least 2, got 1"),
        (np.zeros((3, 4)), 0, "components: expected a number from 1 on, got 0"),
    ],
)
def test_bad_input_is_named(rows, components, message):
    with pytest.raises(InputError, match=message):
        fit_pca(rows, components)
