from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mien.errors import InputError
from mien.rig.basis import Basis, check_weights, outside_hull


def pca(m: int) -> Basis:
    return Basis.by_pca(np.random.default_rng(m).normal(size=(m, 30)))


ALL = pytest.mark.parametrize("make", [Basis.by_differences, Basis.by_gram_schmidt, pca])


def projector(columns: np.ndarray) -> np.ndarray:
    return columns @ np.linalg.pinv(columns)


@ALL
@pytest.mark.parametrize("m", [1, 2, 3, 7])
def test_the_columns_span_the_plane_of_zero_sum(make: Callable[[int], Basis], m: int) -> None:
    basis = make(m)
    assert basis.Q.shape == (m, m - 1)
    np.testing.assert_allclose(projector(basis.Q), np.eye(m) - 1 / m, atol=1e-12)
    np.testing.assert_allclose(basis.w_star, 1 / m)


@ALL
@pytest.mark.parametrize("m", [1, 2, 5])
def test_weights_to_parameters_and_back(
    make: Callable[[int], Basis], m: int, rng: np.random.Generator
) -> None:
    basis = make(m)
    alpha = rng.normal(size=(4, 3, m - 1))
    weights = basis.weights(alpha)
    np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(basis.alpha(weights), alpha, atol=1e-12)
    np.testing.assert_allclose(basis.weights(basis.alpha(np.eye(m))), np.eye(m), atol=1e-12)


def test_no_parameters_mean_the_mean() -> None:
    np.testing.assert_allclose(Basis.by_differences(4).weights(np.zeros(3)), 0.25)


def test_a_difference_moves_weight_from_the_reference_to_one_expression() -> None:
    basis = Basis.by_differences(4, reference=2)
    np.testing.assert_array_equal(basis.Q.T, [[1, 0, -1, 0], [0, 1, -1, 0], [0, 0, -1, 1]])


def test_gram_schmidt_by_hand() -> None:
    """Three expressions: (-1, 1, 0), and of (-1, 0, 1) what stands at right angles to it."""
    expected = np.array([[-1, 1, 0], [-1, -1, 2]]) / np.sqrt([[2], [6]])
    np.testing.assert_allclose(Basis.by_gram_schmidt(3).Q.T, expected, atol=1e-15)


@pytest.mark.parametrize("make", [Basis.by_gram_schmidt, pca])
def test_orthonormal(make: Callable[[int], Basis]) -> None:
    Q = make(6).Q
    np.testing.assert_allclose(Q.T @ Q, np.eye(5), atol=1e-12)


def test_pca_orders_by_what_a_step_changes(rng: np.random.Generator) -> None:
    examples = rng.normal(size=(6, 40)) * np.arange(1, 7)[:, None]
    basis = Basis.by_pca(examples)
    steps = basis.Q.T @ examples
    lengths = np.linalg.norm(steps, axis=1)
    assert (np.diff(lengths) < 0).all()
    singular = np.linalg.svd(examples - examples.mean(axis=0), compute_uv=False)
    np.testing.assert_allclose(lengths, singular[:5], rtol=1e-10)
    across = steps @ steps.T - np.diag(lengths**2)
    np.testing.assert_allclose(across, 0, atol=1e-9 * lengths[0] ** 2)


def test_pca_cut_short_is_the_best_of_its_size(rng: np.random.Generator) -> None:
    examples = rng.normal(size=(7, 50))
    kept = Basis.by_pca(examples, count=3)
    assert kept.Q.shape == (7, 3)
    found = kept.weights(kept.alpha(np.eye(7))) @ examples
    singular = np.linalg.svd(examples - examples.mean(axis=0), compute_uv=False)
    np.testing.assert_allclose(np.sum((found - examples) ** 2), np.sum(singular[3:] ** 2))


def test_pca_puts_what_duplicates_share_last(rng: np.random.Generator) -> None:
    face, smile, frown = rng.normal(size=(3, 20))
    examples = np.array([face, smile, face, frown])
    basis = Basis.by_pca(examples)
    np.testing.assert_allclose(projector(basis.Q), np.eye(4) - 1 / 4, atol=1e-12)
    np.testing.assert_allclose(np.abs(basis.Q[:, 2]), np.sqrt([0.5, 0, 0.5, 0]), atol=1e-7)
    np.testing.assert_allclose(basis.Q[:, 2] @ examples, 0, atol=1e-7)
    short = Basis.by_pca(examples, count=2)
    np.testing.assert_allclose(
        short.weights(short.alpha(np.eye(4))) @ examples, examples, atol=1e-12
    )


def test_pca_of_one_face_many_times() -> None:
    basis = Basis.by_pca(np.ones((3, 5)))
    np.testing.assert_allclose(projector(basis.Q), np.eye(3) - 1 / 3, atol=1e-12)


def test_alpha_is_the_least_squares_optimum(rng: np.random.Generator) -> None:
    basis = Basis.by_pca(rng.normal(size=(5, 9)), count=2)
    weights = rng.dirichlet(np.ones(5))
    alpha = basis.alpha(weights)

    def cost(parameters: np.ndarray) -> float:
        return float(np.sum((basis.weights(parameters) - weights) ** 2))

    for nudge in 1e-3 * np.vstack([np.eye(2), -np.eye(2)]):
        assert cost(alpha + nudge) > cost(alpha)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Basis.by_differences(0), "m: expected at least one expression, got 0"),
        (lambda: Basis.by_gram_schmidt(3, reference=3), "reference: expected .* 0 to 2, got 3"),
        (lambda: Basis.by_pca(np.ones((3, 4)), count=3), "count: expected 0 to 2 columns, got 3"),
        (lambda: Basis.by_pca(np.full((3, 4), np.nan)), "examples: expected finite numbers"),
        (lambda: Basis.by_pca(np.ones((0, 4))), "at least one expression"),
        (lambda: Basis(np.ones((3, 2)), np.full(3, 1 / 3)), "Q: expected columns that sum to 0"),
        (lambda: Basis(np.zeros((3, 2)), np.full(3, 1 / 3)), "Q: expected linearly independent"),
        (lambda: Basis(np.zeros((3, 0)), np.ones(3)), "w_star: .* sum to 1, got the sum 3"),
        (lambda: Basis.by_differences(3).weights(np.zeros(3)), r"alpha: .* got shape \(3,\)"),
        (lambda: Basis.by_differences(3).alpha(np.zeros(2)), r"weights: .* got shape \(2,\)"),
    ],
)
def test_bad_input_is_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize("weights", [[1.0], [-0.5, 1.5], [[0.25, 0.75], [1.2, -0.2]]])
def test_good_weights_pass(weights: list) -> None:
    np.testing.assert_array_equal(check_weights(weights), weights)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([0.5, 0.6], "mouth: expected weights that sum to 1, got the sum 1.1"),
        ([[0.5, 0.5], [0.5, 0.4]], "mouth: expected weights that sum to 1, got the sum 0.9"),
        ([-0.6, 1.6], "mouth: expected weights from -0.5 to 1.5, got -0.6"),
        ([np.nan, 1.0], "mouth: expected finite numbers"),
        (["a", "b"], "mouth: expected numbers"),
        ([], "mouth: expected weights that sum to 1, got the sum 0"),
    ],
)
def test_bad_weights_are_named(weights: list, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_weights(weights, name="mouth")


def test_the_hulls_border_is_inside() -> None:
    assert outside_hull([0.0, 1.0, 0.0]) is None
    assert outside_hull([[0.5, 0.5], [0.2, 0.8]], ["neutral", "joy"]) is None


def test_beyond_the_hull_names_expressions_and_weights() -> None:
    frames = [[0.5, 0.5, 0.0], [-0.1, 1.1, 0.0], [-0.25, 1.25, 0.0]]
    warning = outside_hull(frames, ["neutral", "joy", "anger"])
    assert warning is not None
    assert "neutral -0.25, joy 1.25" in warning
    assert "anger" not in warning
    assert "0 -0.2" in str(outside_hull([-0.2, 1.2]))
