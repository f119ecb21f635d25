"""Piecewise-affine correspondences: where in other pictures each pixel of a triangulation lies."""

from __future__ import annotations

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.numeric.raster import Raster, check_triangles, rasterize

__all__ = ["corner_places", "place", "triangulated"]


def triangulated(
    points: Float[Array, "n 2"], triangles: Int[Array, "t 3"], width: int, height: int
) -> Raster:
    """Which triangle holds each pixel's centre, and its barycentrics there.

    Args:
        points: (n, 2) px. triangles: (T, 3), either way around; where they overlap, the first.
    Raises: InputError: shapes, NaN, sizes, an index out of range.
    """
    points = check_array("points", points, (None, 2))
    return rasterize(points, np.ones(len(points)), triangles, width, height)


def corner_places(
    points: Float[Array, "m n 2"], triangles: Int[Array, "t 3"]
) -> Float[Array, "t m 6"]:
    """The triangles' corners in each of m pictures, x and y in turn, as `place` takes them.

    Args:
        points: (m, n, 2) px of each picture.
    Returns: (T, m, 6) float32; a triangle's are side by side.
    Raises: InputError: shapes, NaN, an index out of range.
    """
    points = check_array("points", points, (None, None, 2))
    corners = points[:, check_triangles(triangles, points.shape[1])]
    flat = corners.reshape(len(points), len(triangles), 6).transpose(1, 0, 2)
    return frozen(np.ascontiguousarray(flat, np.float32))


@njit(inline="always")
def place(
    corners: Array, t: int, picture: int, b0: np.float32, b1: np.float32, b2: np.float32
) -> tuple[np.float32, np.float32]:
    """Where in a picture the point of triangle t with these barycentrics lies, px."""
    x = b0 * corners[t, picture, 0] + b1 * corners[t, picture, 2] + b2 * corners[t, picture, 4]
    y = b0 * corners[t, picture, 1] + b1 * corners[t, picture, 3] + b2 * corners[t, picture, 5]
    return x, y
