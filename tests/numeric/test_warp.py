"""Piecewise-affine correspondences against affine maps that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from mien.errors import InputError
from mien.numeric.raster import interpolate
from mien.numeric.warp import corner_places, place, triangulated

WIDTH, HEIGHT = 60, 40
MATRIX, SHIFT = np.array([[0.9, 0.2], [-0.1, 1.1]]), np.array([3.0, -2.0])


@pytest.fixture
def points():
    corners = np.array([[0, 0], [WIDTH, 0], [0, HEIGHT], [WIDTH, HEIGHT]], float)
    inner = np.random.default_rng(0).uniform([0, 0], [WIDTH, HEIGHT], (20, 2))
    return np.concatenate([corners, inner])


@pytest.fixture
def triangles(points):
    return Delaunay(points).simplices


def centres():
    return np.stack(np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5), -1)


def test_every_pixel_has_its_triangle_and_lies_where_its_barycentrics_say(points, triangles):
    raster = triangulated(points, triangles, WIDTH, HEIGHT)
    assert raster.mask.all()
    np.testing.assert_allclose(interpolate(raster, triangles, points), centres(), atol=1e-4)


def test_an_affine_motion_of_all_points_is_that_of_every_pixel(points, triangles):
    raster = triangulated(points, triangles, WIDTH, HEIGHT)
    corners = corner_places(np.stack([points, points @ MATRIX.T + SHIFT]), triangles)
    expected = centres() @ MATRIX.T + SHIFT
    for row, col in [(0, 0), (13, 27), (39, 59)]:
        t, b = raster.triangle_ids[row, col], raster.barycentrics[row, col]
        assert place(corners, t, 1, *b) == pytest.approx(expected[row, col], abs=1e-4)


def test_triangles_may_go_either_way_around(points, triangles):
    there = triangulated(points, triangles, WIDTH, HEIGHT)
    back = triangulated(points, triangles[:, ::-1], WIDTH, HEIGHT)
    np.testing.assert_array_equal(there.triangle_ids, back.triangle_ids)


def test_bad_input_is_named(points, triangles):
    with pytest.raises(InputError, match="finite"):
        triangulated(points * np.nan, triangles, WIDTH, HEIGHT)
    with pytest.raises(InputError, match="triangles"):
        corner_places(points[None, :5], triangles)
