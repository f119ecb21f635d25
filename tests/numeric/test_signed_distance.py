from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.numeric.signed_distance import penetration_depths


def sphere(rings: int = 24, segments: int = 48) -> tuple[Array, Array]:
    """A unit sphere, counter-clockwise from outside."""
    polar, around = np.meshgrid(
        np.linspace(0.02, np.pi - 0.02, rings),
        np.linspace(0, 2 * np.pi, segments, endpoint=False),
        indexing="ij",
    )
    x, y = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)
    vertices = np.stack([x, y, np.cos(polar)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(segments), indexing="ij")
    a, b = i * segments + j, i * segments + (j + 1) % segments
    c, d = a + segments, b + segments
    return vertices, np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3)


def test_depth_in_a_sphere_is_the_distance_to_its_surface(rng: np.random.Generator) -> None:
    vertices, triangles = sphere()
    points = rng.normal(size=(200, 3))
    points *= rng.uniform(0.5, 1.4, (200, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    radius = np.linalg.norm(points, axis=1)
    points, radius = points[np.abs(radius - 1) > 0.02], radius[np.abs(radius - 1) > 0.02]
    border = np.zeros(len(vertices), bool)
    depth, triangle, weights = penetration_depths(points, vertices, triangles, border, 1.0)
    np.testing.assert_allclose(depth, np.maximum(1 - radius, 0), atol=0.015)
    np.testing.assert_array_equal(triangle >= 0, radius < 1)
    inside = radius < 1
    nearest = (weights[inside][..., None] * vertices[triangles[triangle[inside]]]).sum(axis=1)
    away = np.linalg.norm(nearest - points[inside], axis=1)
    np.testing.assert_allclose(away, depth[inside], atol=1e-12)
    np.testing.assert_allclose(weights[inside].sum(axis=1), 1)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 0.1, -0.5), 0.5),  # under the middle
        ((0.0, 0.1, 0.5), 0.0),  # above it
        ((0.0, 0.1, -2.5), 0.0),  # out of reach
    ],
)
def test_a_single_triangle(point: tuple[float, float, float], expected: float) -> None:
    vertices, triangles = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 2, 0]]), np.array([[0, 1, 2]])
    depth = penetration_depths(np.array([point]), vertices, triangles, np.zeros(3, bool), 2.0)[0]
    np.testing.assert_allclose(depth, [expected])


def test_nothing_is_below_where_the_surface_ends() -> None:
    vertices, triangles = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 2, 0]]), np.array([[0, 1, 2]])
    points = np.array([[0.0, 0.1, -0.5]])
    depth, triangle, _ = penetration_depths(points, vertices, triangles, np.ones(3, bool), 2.0)
    assert depth[0] == 0
    assert triangle[0] == -1
