from __future__ import annotations

import numba
import numpy as np
import pytest

from mien.arrays import Array
from mien.errors import InputError
from mien.numeric.raster.rasterizer import Raster, interpolate, rasterize


def fan(rng: np.random.Generator, size: int) -> tuple[Array, Array]:
    """A disc of triangles around random points, every edge inside shared by two of them."""
    from scipy.spatial import Delaunay

    points = rng.uniform(0, size, (60, 2))
    # Many vertices exactly on pixel centres: the hard case of the fill rule.
    points[:30] = np.floor(points[:30]) + 0.5
    corners = np.array([[0, 0], [size, 0], [0, size], [size, size]], float)
    points = np.vstack([points, corners])
    return points, Delaunay(points).simplices.astype(np.int32)


def test_shared_edges_have_no_gaps_and_no_double_hits(rng: np.random.Generator) -> None:
    points, triangles = fan(rng, 48)
    hits = np.zeros((48, 48), int)
    for triangle in triangles:
        hits += rasterize(points, np.ones(len(points)), triangle[None], 48, 48).mask
    assert (hits == 1).all()


def test_pixels_are_sampled_at_their_centres_and_top_left_edges_belong() -> None:
    square = np.array([[1.5, 1.5], [4.5, 1.5], [4.5, 3.5], [1.5, 3.5]])
    raster = rasterize(square, np.ones(4), np.array([[0, 3, 2], [0, 2, 1]]), 7, 6)
    expected = np.zeros((6, 7), bool)
    expected[1:3, 1:4] = True
    np.testing.assert_array_equal(raster.mask, expected)


@pytest.mark.parametrize("size", [3, 12, 60])
def test_a_triangle_shows_where_all_its_edges_say_so(rng: np.random.Generator, size: int) -> None:
    """Narrow and wide ones, many with corners at centres and edges along rows and columns."""
    columns, rows = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5)
    on_centres = rng.integers(0, size, (30, 3, 2)) + 0.5
    for corners in np.concatenate([rng.uniform(0, size, (30, 3, 2)), on_centres]):
        way = np.sign(np.linalg.det(corners[1:] - corners[0]).round(9))
        inside = np.full((64, 64), way != 0)
        for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            dx, dy = way * (x1 - x0), way * (y1 - y0)
            line = dx * (rows - y0) - dy * (columns - x0)
            inside &= (line >= 0) if dy < 0 or (dy == 0 and dx > 0) else (line > 0)
        shown = rasterize(corners, np.ones(3), np.array([[0, 1, 2]]), 64, 64).mask
        np.testing.assert_array_equal(shown, inside)


@pytest.mark.parametrize("turn", [[0, 1, 2], [0, 2, 1], [1, 2, 0]])
def test_barycentrics_are_perspective_correct(turn: list[int]) -> None:
    corners = np.array([[-30.0, -20, 300], [35, -10, 500], [0, 40, 900]])
    pixels = 400 * corners[:, :2] / corners[:, 2:] + 50
    raster = rasterize(pixels, corners[:, 2], np.array([turn]), 100, 100)
    rows, columns = np.nonzero(raster.mask)
    points = raster.barycentrics[rows, columns] @ corners[turn]
    seen = 400 * points[:, :2] / points[:, 2:] + 50
    assert len(rows) > 500
    np.testing.assert_allclose(seen, np.column_stack([columns, rows]) + 0.5, atol=1e-4)
    np.testing.assert_allclose(raster.depth[rows, columns], points[:, 2], rtol=1e-5)
    np.testing.assert_allclose(raster.barycentrics[rows, columns].sum(axis=1), 1, atol=1e-6)


def test_the_nearest_wins_and_of_equals_the_first() -> None:
    square = np.tile([[0.0, 0], [9, 0], [0, 9]], (3, 1))
    depth = np.repeat([5.0, 2.0, 2.0], 3)
    raster = rasterize(square, depth, np.arange(9).reshape(3, 3), 9, 9)
    assert set(np.unique(raster.triangle_ids)) == {-1, 1}
    assert raster.depth[0, 0] == 2
    assert np.isinf(raster.depth[8, 8])


def test_culling_leaves_out_what_is_seen_from_behind() -> None:
    front = np.array([[0.0, 0], [0, 9], [9, 0]])  # Counter-clockwise to the eye; y points down.
    depth = np.ones(3)
    assert rasterize(front, depth, np.array([[0, 1, 2]]), 9, 9, cull=True).mask.any()
    assert not rasterize(front, depth, np.array([[0, 2, 1]]), 9, 9, cull=True).mask.any()


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_triangles_at_or_behind_the_camera_are_skipped(bad: float) -> None:
    corners = np.array([[0.0, 0], [9, 0], [0, 9]])
    assert not rasterize(corners, np.array([1, 1, bad]), np.array([[0, 1, 2]]), 9, 9).mask.any()


def test_corners_far_outside_or_not_finite_do_no_harm() -> None:
    corners = np.array([[-1e12, -1e12], [1e12, -1e12], [0, 1e12], [np.nan, 3]])
    raster = rasterize(corners, np.ones(4), np.array([[0, 1, 2], [0, 1, 3]]), 8, 8)
    assert (raster.triangle_ids == 0).all()
    shapes = np.array(
        [[[-1, -1], [1, -1], [0, 1]], [[0, 1], [1, 2], [3, 1]], [[5, 0], [0, 5], [9, 9]]]
    )
    for far in (1e30, 1e155, 1e300):
        for corners in far * shapes:
            ids = rasterize(corners, np.ones(3), np.array([[0, 1, 2]]), 8, 8).triangle_ids
            assert set(np.unique(ids)) <= {-1, 0}


def test_same_bytes_whatever_the_number_of_threads(rng: np.random.Generator) -> None:
    points, triangles = fan(rng, 400)
    depth = rng.uniform(1, 2, len(points))
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = rasterize(points, depth, triangles, 400, 400)
    finally:
        numba.set_num_threads(before)
    shared = rasterize(points, depth, triangles, 400, 400)
    for name in ("triangle_ids", "barycentrics", "depth"):
        assert getattr(alone, name).tobytes() == getattr(shared, name).tobytes()


def test_interpolation_reproduces_a_linear_function(rng: np.random.Generator) -> None:
    points, triangles = fan(rng, 40)
    raster = rasterize(points, np.ones(len(points)), triangles, 40, 40)
    rows, columns = np.mgrid[:40, :40] + 0.5
    values = interpolate(raster, triangles, points @ np.array([[2.0, 0.5], [-1, 3]]))
    expected = np.stack([2 * columns - rows, 0.5 * columns + 3 * rows], axis=2)
    np.testing.assert_allclose(values, expected, atol=2e-4)


def test_outside_the_mesh_is_empty() -> None:
    raster = rasterize(np.zeros((3, 2)), np.ones(3), np.array([[0, 1, 2]]), 4, 3)
    assert not raster.mask.any()
    assert np.isinf(raster.depth).all()
    assert not interpolate(raster, np.array([[0, 1, 2]]), np.ones((3, 1))).any()


def test_bad_input_is_refused() -> None:
    triangle = np.array([[0, 1, 2]])
    with pytest.raises(InputError, match=r"vertices_px: expected shape \(any, 2\)"):
        rasterize(np.zeros((3, 3)), np.ones(3), triangle, 4, 4)
    with pytest.raises(InputError, match=r"depth: expected shape \(3\)"):
        rasterize(np.zeros((3, 2)), np.ones(2), triangle, 4, 4)
    with pytest.raises(InputError, match="triangles: expected indices from 0 to 2, got 0 to 3"):
        rasterize(np.zeros((3, 2)), np.ones(3), np.array([[0, 1, 3]]), 4, 4)
    with pytest.raises(InputError, match="width: expected a number above zero, got 0"):
        rasterize(np.zeros((3, 2)), np.ones(3), triangle, 0, 4)
    seen = Raster(np.ones((2, 2), np.int32), np.ones((2, 2, 3), np.float32), np.ones((2, 2)))
    with pytest.raises(InputError, match="triangles: expected those that were rasterised"):
        interpolate(seen, triangle, np.ones((3, 1)))
