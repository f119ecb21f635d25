"""Photos warped to other points."""

from __future__ import annotations

import numpy as np

from mien.numeric.raster.rasterizer import rasterize
from mien.synthesis.composition.example_warping import warp_to_raster

SQUARE = np.array([[10.0, 10.0], [50.0, 10.0], [50.0, 50.0], [10.0, 50.0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def ramps() -> np.ndarray:
    """Red is twice x, green is twice y, at pixels' centres."""
    rows, columns = np.mgrid[:100, :100]
    picture = np.stack([2 * columns + 1, 2 * rows + 1, 0 * rows], axis=-1)
    return picture.astype(np.uint8)


def test_every_pixel_shows_its_position_in_the_photo():
    """The square is turned by a quarter, made half as large and moved."""
    points = np.array([[20.0, 40.0], [20.0, 20.0], [40.0, 20.0], [40.0, 40.0]])
    raster = rasterize(SQUARE, np.ones(4), TRIANGLES, 60, 60)
    warped = warp_to_raster(ramps(), points, TRIANGLES, raster)
    rows, columns = np.nonzero(raster.mask)
    x, y = columns + 0.5, rows + 0.5
    expected = np.stack([2 * (20 + (y - 10) / 2), 2 * (40 - (x - 10) / 2)], axis=-1)
    np.testing.assert_allclose(warped[rows, columns, :2], expected, atol=0.6)
    assert (warped[~raster.mask] == 0).all()
