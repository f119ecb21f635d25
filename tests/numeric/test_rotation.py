"""Rotations: laws, and the ends of the range where formulas divide by zero."""

from __future__ import annotations

import numpy as np
import pytest

from mien.numeric.rotation import (
    angle_between,
    cross_matrix,
    rotation_from_vector,
    rotation_to_vector,
)


def random_vectors(rng, count, largest=np.pi - 1e-3):
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return axes * rng.uniform(0, largest, (count, 1))


def test_matrices_are_rotations(rng):
    matrices = rotation_from_vector(random_vectors(rng, 50))
    np.testing.assert_allclose(
        matrices @ np.swapaxes(matrices, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(matrices), 1)


def test_vector_and_matrix_are_inverse(rng):
    vectors = random_vectors(rng, 50)
    np.testing.assert_allclose(
        rotation_to_vector(rotation_from_vector(vectors)), vectors, atol=1e-12
    )


def test_rodrigues_formula(rng):
    vector = random_vectors(rng, 1)[0]
    angle = np.linalg.norm(vector)
    cross = cross_matrix(vector / angle)
    expected = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    np.testing.assert_allclose(rotation_from_vector(vector), expected, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, np.pi - 1e-8, np.pi])
def test_angles_at_the_ends(angle):
    vector = angle * np.array([0.6, 0.0, 0.8])
    matrix = rotation_from_vector(vector)
    np.testing.assert_allclose(
        np.abs(rotation_to_vector(matrix)), vector, atol=1e-15 + 4e-8 * angle**9
    )
    assert angle_between(np.eye(3), matrix) == pytest.approx(angle, rel=1e-7, abs=1e-15)


def test_turns_about_one_axis_add_up():
    axis = np.array([1.0, 2.0, -2.0]) / 3
    product = rotation_from_vector(0.4 * axis) @ rotation_from_vector(0.5 * axis)
    np.testing.assert_allclose(product, rotation_from_vector(0.9 * axis), atol=1e-15)


def test_batches_keep_their_shape(rng):
    vectors = random_vectors(rng, 12).reshape(3, 4, 3)
    matrices = rotation_from_vector(vectors)
    assert matrices.shape == (3, 4, 3, 3)
    assert rotation_to_vector(matrices).shape == (3, 4, 3)
    assert angle_between(matrices, matrices).shape == (3, 4)


def test_cross_matrix_is_the_cross_product(rng):
    a, b = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose((cross_matrix(a) @ b[..., None])[..., 0], np.cross(a, b))
