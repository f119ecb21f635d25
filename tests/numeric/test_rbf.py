"""Scattered data interpolation."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.numeric import rbf
from mien.numeric.rbf import PAPER_RADIUS, fit_rbf

KERNELS = {
    "exponential": None,
    "gaussian": 60.0,
    "biharmonic": None,
    "triharmonic": None,
    "thin_plate": None,
}


@pytest.fixture
def head(rng):
    """Points the size of a head, in mm."""
    return rng.uniform(-100, 100, (40, 3))


@pytest.mark.parametrize(("kernel", "radius"), KERNELS.items())
class TestEveryKernel:
    def test_passes_through_the_values(self, rng, head, kernel, radius):
        values = rng.normal(size=(40, 2))
        f = fit_rbf(head, values, kernel=kernel, radius=radius)
        np.testing.assert_allclose(f(head), values, atol=1e-8)

    def test_reproduces_affine_functions_everywhere(self, rng, head, kernel, radius):
        slope, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
        f = fit_rbf(head, head @ slope + shift, kernel=kernel, radius=radius)
        far = rng.uniform(-500, 500, (20, 3))
        np.testing.assert_allclose(f(far), far @ slope + shift, atol=1e-6)

    def test_side_conditions(self, rng, head, kernel, radius):
        f = fit_rbf(head, rng.normal(size=(40, 1)), kernel=kernel, radius=radius)
        size = np.abs(f.coefficients).sum()
        assert abs(f.coefficients.sum()) < 1e-9 * size
        assert np.abs(f.coefficients.T @ head).max() < 1e-7 * size

    def test_smoothing_goes_to_the_affine_fit(self, rng, head, kernel, radius):
        values = rng.normal(size=(40, 1))
        f = fit_rbf(head, values, kernel=kernel, radius=radius, smoothing=1e12)
        design = np.column_stack([head, np.ones(40)])
        best = design @ np.linalg.lstsq(design, values, rcond=None)[0]
        np.testing.assert_allclose(f(head), best, atol=1e-3)

    @pytest.mark.parametrize("count", [1, 2, 3])
    def test_few_points(self, rng, head, kernel, radius, count):
        values = rng.normal(size=(count, 3))
        f = fit_rbf(head[:count], values, kernel=kernel, radius=radius)
        np.testing.assert_allclose(f(head[:count]), values, atol=1e-9)

    def test_points_on_a_plane(self, rng, head, kernel, radius):
        flat = head * [1, 1, 0] + [0, 0, 7]
        values = rng.normal(size=(40, 3))
        f = fit_rbf(flat, values, kernel=kernel, radius=radius)
        np.testing.assert_allclose(f(flat), values, atol=1e-8)
        assert np.isfinite(f(head)).all()


def test_the_papers_kernel(rng, head):
    values = rng.normal(size=(40, 1))
    f = fit_rbf(head, values)
    assert f.radius == PAPER_RADIUS == pytest.approx(1625.6)
    place = np.array([[10.0, 20, 30]])
    phi = np.exp(-np.linalg.norm(place - head, axis=1) / 1625.6)
    terms = np.append(1.0, f.axes @ (place[0] - f.origin))
    assert f(place)[0, 0] == pytest.approx((phi @ f.coefficients + terms @ f.affine)[0], abs=1e-8)


def test_six_hundred_points_in_millimetres_stay_exact(rng):
    points = rng.uniform(-100, 100, (600, 3))
    values = rng.normal(size=(600, 3))
    np.testing.assert_allclose(fit_rbf(points, values)(points), values, atol=1e-7)


def test_one_point_moves_everything():
    f = fit_rbf([[1.0, 2, 3]], [[4.0, 5, 6]])
    np.testing.assert_allclose(f([[9.0, 9, 9], [0, 0, 0]]), [[4, 5, 6], [4, 5, 6]])


def test_coinciding_points_are_averaged(rng, head):
    values = rng.normal(size=(40, 1))
    f = fit_rbf(np.vstack([head, head[:1]]), np.vstack([values, values[:1] + 2]))
    assert f(head[:1])[0, 0] == pytest.approx(values[0, 0] + 1)
    np.testing.assert_allclose(f(head[1:]), values[1:], atol=1e-8)


def test_blocks_do_not_change_the_answer(rng, head, monkeypatch):
    f = fit_rbf(head, rng.normal(size=(40, 3)))
    places = rng.uniform(-100, 100, (101, 3))
    whole = f(places)
    monkeypatch.setattr(rbf, "_MAX_BLOCK", 7 * 40)
    np.testing.assert_allclose(f(places), whole, atol=1e-12)


def test_a_turned_head_deforms_alike(rng, head):
    from mien.numeric.rotation import rotation_from_vector

    turn = rotation_from_vector(np.array([0.4, 1.0, -0.2]))
    moves, places = rng.normal(size=(40, 3)), rng.uniform(-100, 100, (10, 3))
    turned = fit_rbf(head @ turn.T, moves @ turn.T)(places @ turn.T)
    np.testing.assert_allclose(turned, fit_rbf(head, moves)(places) @ turn.T, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": np.zeros((0, 3)), "values": np.zeros((0, 1))}, "at least one point"),
        ({"points": np.zeros((4, 2))}, r"points: expected shape \(any, 3\)"),
        ({"values": np.full((40, 1), np.nan)}, "values: expected finite numbers"),
        ({"values": np.zeros((39, 1))}, r"values: expected shape \(40, any\)"),
        ({"kernel": "cubic"}, "kernel: expected exponential or gaussian .* got cubic"),
        ({"kernel": "gaussian"}, "radius: expected a number above zero for the gaussian"),
        ({"radius": -1.0}, "radius: expected a number above zero, got -1.0"),
        ({"smoothing": -1.0}, "smoothing: expected numbers of 0 or more"),
    ],
)
def test_refuses_bad_input(head, change, message):
    with pytest.raises(InputError, match=message):
        fit_rbf(**{"points": head, "values": np.zeros((40, 1)), **change})


def test_says_when_the_equations_are_singular(head):
    with pytest.raises(EstimationError, match="too close together"):
        fit_rbf(head, np.zeros((40, 1)), kernel="gaussian", radius=1e6)
