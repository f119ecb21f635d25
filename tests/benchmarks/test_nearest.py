"""Nearest points of surfaces whose distance is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh", reason="the benchmarks need trimesh")
from benchmarks.nearest import NearestPoint  # noqa: E402

HALF = np.array([50.0, 30.0, 20.0])


def distance_to_box(points: np.ndarray) -> np.ndarray:
    """Exact distance to the surface of the box of these half sides."""
    beyond = np.abs(points) - HALF
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    return np.where((beyond < 0).all(axis=1), -beyond.max(axis=1), outside)


@pytest.fixture(scope="module")
def box() -> NearestPoint:
    return NearestPoint(trimesh.creation.box(extents=2 * HALF))


def test_distances_to_a_box_are_exact(box: NearestPoint, rng: np.random.Generator) -> None:
    points = rng.uniform(-90, 90, size=(500, 3))
    closest, distances = box(points)
    np.testing.assert_allclose(distances, distance_to_box(points), atol=1e-9)
    np.testing.assert_allclose(distance_to_box(closest), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distances, atol=1e-9)


def test_a_point_of_the_surface_is_its_own_nearest(
    box: NearestPoint, rng: np.random.Generator
) -> None:
    points = rng.uniform(-HALF, HALF, size=(100, 3))
    points[:, 1] = HALF[1]
    closest, distances = box(points)
    np.testing.assert_allclose(closest, points, atol=1e-9)
    np.testing.assert_allclose(distances, 0, atol=1e-9)


def test_a_triangle_without_area_is_passed_over() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    surface = trimesh.Trimesh(corners, [[0, 1, 2], [0, 1, 3]], process=False)
    closest, distances = NearestPoint(surface)(np.array([[0.25, 0.25, 3.0]]))
    np.testing.assert_allclose(closest, [[0.25, 0.25, 0]], atol=1e-12)
    np.testing.assert_allclose(distances, 3)
