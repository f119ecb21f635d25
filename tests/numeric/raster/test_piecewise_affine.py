"""Piecewise-affine correspondences against meshes and affine maps that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from mien.errors import InputError
from mien.numeric.raster.piecewise_affine import (
    SUBPIXELS,
    affine_maps,
    orient_triangles,
    row_extents,
    scanline_spans,
    to_subpixels,
)

WIDTH, HEIGHT = 60, 40
MATRIX, SHIFT = np.array([[0.9, 0.2], [-0.1, 1.1]]), np.array([3.0, -2.0])


@pytest.fixture
def points():
    """Some at random, some on the centres of pixels and in one row."""
    corners = np.array([[0, 0], [WIDTH, 0], [0, HEIGHT], [WIDTH, HEIGHT]], float)
    rng = np.random.default_rng(0)
    inner = rng.uniform([1, 1], [WIDTH - 1, HEIGHT - 1], (20, 2))
    even = np.array([[10.5, 7.5], [20.5, 7.5], [33.5, 7.5], [20.5, 30.5], [41.5, 29.5]])
    return np.concatenate([corners, inner, even])


@pytest.fixture
def triangles(points):
    return Delaunay(points).simplices


def owners(points, triangles):
    """Each pixel's triangle."""
    corners = to_subpixels(points)
    drawn = np.empty((HEIGHT, WIDTH), np.int32)
    count = len(triangles)
    found = np.empty((count, 3), np.int64)
    starts, spans = np.empty(2 * count + 2, np.int64), np.empty(2 * count + 1, np.int64)
    tops, ends = row_extents(corners, triangles)
    for row in range(HEIGHT):
        count = scanline_spans(corners, triangles, tops, ends, row, WIDTH, found, starts, spans)
        assert starts[0] == 0
        assert starts[count] == WIDTH
        drawn[row] = np.repeat(spans[:count], np.diff(starts[: count + 1]))
    return drawn


def covered(points, triangles):
    """How many triangles hold each pixel."""
    alone = [owners(points, triangles[t : t + 1]) == 0 for t in range(len(triangles))]
    return np.sum(alone, axis=0)


def centres():
    return np.stack(np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5), -1)


@pytest.mark.parametrize("seed", range(5))
def test_triangles_that_share_edges_share_no_pixel_and_leave_none(points, triangles, seed):
    """Those that face less those that are folded over: the border's winding number, everywhere."""
    faces = orient_triangles(triangles, points)
    moved = points.copy()
    # In coarse steps too: many corners and edges fall on the centres of pixels.
    step = np.random.default_rng(seed).normal(0, 0.3, points[4:].shape)
    moved[4:] += np.round(step * 2) / 2 if seed % 2 else step
    assert (covered(moved, faces) - covered(moved, faces[:, ::-1]) == 1).all()


def cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def signed_areas(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return cross(b - a, c - a)


def test_no_pixel_is_drawn_twice_where_nothing_folds(points, triangles):
    assert (covered(points, orient_triangles(triangles, points)) == 1).all()


def test_however_inner_points_move_all_is_covered(points, triangles):
    """What folds over is not drawn; what lies over it is."""
    moved = points.copy()
    moved[4:] = np.random.default_rng(1).uniform(0, 40, points[4:].shape)
    faces = orient_triangles(triangles, points)
    assert (signed_areas(moved, faces) < 0).any()
    assert (covered(moved, faces) >= 1).all()


def test_a_pixel_is_of_the_triangle_that_holds_its_centre(points, triangles):
    faces = orient_triangles(triangles, points)
    drawn = owners(points, faces)
    a, b, c = np.moveaxis(points[faces[drawn]], 2, 0)
    for p, q in ((a, b), (b, c), (c, a)):
        assert (cross(q - p, centres() - p) >= -1e-2 * np.abs(q - p).max()).all()


def test_triangles_may_go_either_way_around(points, triangles):
    there, back = orient_triangles(triangles, points), orient_triangles(triangles[:, ::-1], points)
    np.testing.assert_array_equal(owners(points, there), owners(points, back))


def test_an_affine_motion_of_all_points_is_that_of_every_pixel(points, triangles):
    faces, corners = orient_triangles(triangles, points), to_subpixels(points)
    at = corners / SUBPIXELS
    maps = affine_maps(corners, faces, np.stack([at, at @ MATRIX.T + SHIFT]))
    drawn = owners(points, faces)
    steps = centres() - 0.5 - np.floor(at[faces[drawn][..., 0]])
    for picture, expected in enumerate([centres(), centres() @ MATRIX.T + SHIFT]):
        x, by_col, by_row, y, down_col, down_row = np.moveaxis(maps[drawn, picture], -1, 0)
        found = [
            x + by_col * steps[..., 0] + by_row * steps[..., 1],
            y + down_col * steps[..., 0] + down_row * steps[..., 1],
        ]
        np.testing.assert_allclose(np.stack(found, -1), expected - 0.5, atol=1e-9)


def test_whole_pixels_change_nothing_else(points, triangles):
    faces = orient_triangles(triangles, points)
    moved = owners(points + np.array([5, 3]), faces)
    np.testing.assert_array_equal(moved[3:, 5:], owners(points, faces)[:-3, :-5])


def test_points_far_off_are_no_harm(points, triangles):
    faces = orient_triangles(triangles, points)
    far = points.copy()
    far[4:] += 1e12
    assert (covered(far, faces) >= 1).all()


def test_bad_input_is_named(points, triangles):
    with pytest.raises(InputError, match="finite"):
        to_subpixels(points * np.nan)
    with pytest.raises(InputError, match="triangles"):
        orient_triangles(triangles, points[:5])
    with pytest.raises(InputError, match="none without area"):
        orient_triangles([[0, 1, 1]], points)
