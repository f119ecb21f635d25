from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.numeric.raster.coverage import (
    STRIP,
    Coverage,
    barycentrics_at,
    cover_strip,
    prepare_coverage,
)
from mien.numeric.raster.rasterizer import rasterize


def triangle_ids(coverage: Coverage, width: int, height: int) -> Array:
    """All strips put together, (H, W), -1 where nothing is."""
    ids = np.full((height + STRIP, width), -1, np.int32)
    columns = slice(coverage.left, coverage.left + coverage.width)
    for strip in range(len(coverage.starts) // 2):
        part = np.empty((STRIP, coverage.width), np.int32)
        cover_strip(coverage, strip, part, np.empty(part.shape, np.float32))
        ids[strip * STRIP : (strip + 1) * STRIP, columns] = part
    return ids[:height]


def soup(rng: np.random.Generator, count: int = 400) -> tuple[Array, Array, Array]:
    """Triangles of all sizes, some beyond the image, some on pixel centres, seen from any side."""
    middle = rng.uniform(-20, 220, (count, 1, 2))
    size = rng.choice([0.7, 4, 30, 150], (count, 1, 1))
    points = (middle + size * rng.normal(size=(count, 3, 2))).reshape(-1, 2)
    points[::5] = np.floor(points[::5]) + 0.5
    return points, rng.uniform(100, 900, 3 * count), np.arange(3 * count).reshape(-1, 3)


def test_samples_belong_to_the_triangles_that_the_rasteriser_finds(
    rng: np.random.Generator,
) -> None:
    points, depth, triangles = soup(rng)
    coverage = prepare_coverage(points, depth, triangles, 200, 150)
    raster = rasterize(points, depth, triangles, 200, 150)
    found = triangle_ids(coverage, 200, 150)
    assert (raster.triangle_ids >= 0).mean() > 0.9
    # Where two surfaces meet at the same depth, rounding decides.
    assert (found != raster.triangle_ids).mean() < 1e-3


def test_what_lies_behind_is_left_out_and_what_stands_out_is_not(rng: np.random.Generator) -> None:
    wall = np.array([[0.0, 0], [300, 0], [0, 300]])
    points, depth, triangles = soup(rng, 100)
    # The wall is a front; the soup shows its backs, too: some of it before the wall.
    points, depth = np.vstack([points, wall]), np.append(depth, [300, 300, 300])
    triangles = np.vstack([triangles, [len(points) - 3, len(points) - 1, len(points) - 2]])
    coverage = prepare_coverage(points, depth, triangles, 200, 150)
    raster = rasterize(points, depth, triangles, 200, 150)
    assert (raster.triangle_ids == len(triangles) - 1).any()
    assert (triangle_ids(coverage, 200, 150) != raster.triangle_ids).mean() < 1e-3


def test_barycentrics_are_those_of_the_rasteriser(rng: np.random.Generator) -> None:
    points, depth, triangles = soup(rng)
    raster = rasterize(points, depth, triangles, 200, 150)
    planes = prepare_coverage(points, depth, triangles, 200, 150).planes
    rows, columns = np.nonzero(raster.mask)
    for row, col in list(zip(rows, columns, strict=True))[::97]:
        shares = barycentrics_at(planes, raster.triangle_ids[row, col], col + 0.5, row + 0.5)
        np.testing.assert_allclose(shares, raster.barycentrics[row, col], atol=1e-5)


def test_barycentrics_beyond_an_edge_are_clamped_to_it() -> None:
    points = np.array([[10.0, 10], [10, 50], [50, 10]])
    coverage = prepare_coverage(points, np.full(3, 5.0), np.array([[0, 1, 2]]), 60, 60)
    assert barycentrics_at(coverage.planes, 0, 5.0, 30.0) == pytest.approx((0.5, 0.5, 0))


def test_triangles_that_cannot_be_drawn_are_skipped() -> None:
    points = np.array([[0.0, 0], [0, 50], [50, 0], [np.nan, 5], [9, 9], [5, 5], [1e9, 1e9]])
    triangles = np.array([[0, 1, 3], [0, 1, 1], [0, 4, 5], [0, 1, 2], [6, 6, 6]])
    depth = np.array([5.0, 5, 5, 5, 5, 5, np.inf])
    for bad in (0.0, -1.0, np.nan, np.inf):
        depth[2] = bad
        coverage = prepare_coverage(points, depth, triangles, 40, 40)
        assert coverage.width == 0
        assert (triangle_ids(coverage, 40, 40) == -1).all()


def test_only_the_columns_reached_are_kept() -> None:
    points = np.array([[100.0, 10], [100, 30], [120, 10]])
    coverage = prepare_coverage(points, np.ones(3), np.array([[0, 1, 2]]), 200, 50)
    assert (coverage.left, coverage.width) == (96, 24)
