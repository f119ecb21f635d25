"""What a drawing shows of the face, pixel by pixel, and where later guesses put it in the frame.

A face is drawn once on each size. A guess near by moves what was drawn: every pixel goes where the
guess puts its place on the head, and is compared with the frame there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int
from mien.numeric.threads import for_row_bands
from mien.track.drawing import Drawing


class Samples(NamedTuple):
    """A drawing as it is compared with a frame.

    Attributes:
        ids, barycentrics, depth: of Drawing.
        drawn: (h, w) float32 luma, plain or filtered.
        target: (h, w) float32 luma of the frame, plain or filtered alike.
        weights: (h, w) float32; 0 where the pixel or one around it does not show the face.
        slopes: (h, w, 2) float32: how drawn changes at a pixel where it moves by a px to the right,
            and down. first: the mean of drawn's and the target's, for the step from where samples
            were drawn.
        along: (h, w, L) float32: how drawn changes with each direction of the mixture.
        scale: grey levels. Geman and McClure's: a pixel that is off by it counts a quarter.
    """

    ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    depth: Float[Array, "h w"]
    drawn: Float[Array, "h w"]
    target: Float[Array, "h w"]
    weights: Float[Array, "h w"]
    slopes: Float[Array, "h w 2"]
    first: Float[Array, "h w 2"]
    along: Float[Array, "h w l"]
    scale: float


def take_samples(
    drawing: Drawing,
    drawn: Float[Array, "h w"],
    target: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    layers: Float[Array, "h w k"],
    Q: Float[Array, "k l"],
    *,
    scale: float,
) -> Samples:
    """A drawing's samples.

    Args:
        drawn, target: luma, plain or filtered; layers: the expressions' pictures, likewise.
        weights: of the pixels.
        Q: directions in which the mixture changes, P02 eq. (4).
        scale: of Samples.
    """
    height, width = drawing.ids.shape
    slopes, mean = np.empty((2, height, width, 2), np.float32)
    along = np.empty((height, width, Q.shape[1]), np.float32)
    whole = np.empty((height, width), np.float32)
    inputs = (drawing.ids, drawn, target, weights, layers, Q)

    def rows(first: int, end: int) -> None:
        _sample_rows(*inputs, first, end, whole, slopes, mean, along)

    for_row_bands(rows, height, work=2 * width * height)
    shown = (drawing.ids, drawing.barycentrics, drawing.depth)
    return Samples(*shown, drawn, target, whole, slopes, mean, along, scale)


@njit(inline="always")
def _sobel(picture: Array, row: int, col: int) -> tuple[float, float]:
    """How a picture changes at this pixel where the picture moves by a px: minus its gradient."""
    a, b = row - 1, row + 1
    left, right = col - 1, col + 1
    x = picture[a, right] + picture[b, right] - picture[a, left] - picture[b, left]
    y = picture[b, left] + picture[b, right] - picture[a, left] - picture[a, right]
    x += np.float32(2.0) * (picture[row, right] - picture[row, left])
    y += np.float32(2.0) * (picture[b, col] - picture[a, col])
    return -x / np.float32(8.0), -y / np.float32(8.0)


@njit(inline="always")
def _whole(ids: Array, row: int, col: int) -> bool:
    """Whether the pixel and all eight around it show the face.

    At the outline there is no gradient, and a frame's pixel mixes the face with what is behind it.
    """
    if row == 0 or col == 0 or row == ids.shape[0] - 1 or col == ids.shape[1] - 1:
        return False
    for a in range(row - 1, row + 2):
        for b in range(col - 1, col + 2):
            if ids[a, b] < 0:
                return False
    return True


@njit(cache=True, nogil=True, fastmath=True)
def _sample_rows(
    ids: Array,
    drawn: Array,
    target: Array,
    weights: Array,
    layers: Array,
    Q: Array,
    first: int,
    end: int,
    whole: Array,
    slopes: Array,
    mean: Array,
    along: Array,
) -> None:
    """Fill in weights of whole pixels, slopes and along; what has no weight is left as it is.

    The mean of both pictures' slopes takes half the iterations that the drawn one's alone take:
    Benhimane and Malis, Real-time image-based tracking of planes using efficient second-order
    minimization, 2004. It is of no use where samples have moved, for there the target's is another.
    """
    half = np.float32(0.5)
    for row in range(first, end):
        for col in range(ids.shape[1]):
            whole[row, col] = 0.0
            if weights[row, col] == 0.0 or not _whole(ids, row, col):
                continue
            whole[row, col] = weights[row, col]
            drawn_x, drawn_y = _sobel(drawn, row, col)
            target_x, target_y = _sobel(target, row, col)
            slopes[row, col, 0], slopes[row, col, 1] = drawn_x, drawn_y
            mean[row, col, 0] = half * (drawn_x + target_x)
            mean[row, col, 1] = half * (drawn_y + target_y)
            # Eq. (7)'s sum over k of dw_k/dp I^_k, but for the region's share.
            for d in range(Q.shape[1]):
                change = np.float32(0.0)
                for n in range(Q.shape[0]):
                    change += Q[n, d] * layers[row, col, n]
                along[row, col, d] = change


class Moved(NamedTuple):
    """Where a guess puts the head, and how far it is from what was drawn.

    Attributes:
        places: (V, 3) mm, camera space.
        lens: focal length and principal point, px.
        step: (N,) the unknowns less those that were drawn.
    """

    places: Float[Array, "v 3"]
    lens: tuple[float, float, float]
    step: Float[Array, " n"]


@njit(inline="always")
def sample_place(
    corners: tuple[int, int, int],
    b: tuple[float, float, float],
    places: Array,
    lens: tuple[float, float, float],
) -> tuple[float, float]:
    """Where in the picture a place in a triangle is: px from the corner, first centre at 0."""
    i, j, k = corners
    focal, cx, cy = lens
    X = b[0] * places[i, 0] + b[1] * places[j, 0] + b[2] * places[k, 0]
    Y = b[0] * places[i, 1] + b[1] * places[j, 1] + b[2] * places[k, 1]
    Z = b[0] * places[i, 2] + b[1] * places[j, 2] + b[2] * places[k, 2]
    return focal * X / Z + cx - 0.5, focal * Y / Z + cy - 0.5


@njit(inline="always")
def look_up(picture: Array, x: float, y: float) -> float:
    """A picture between its pixels, by Catmull and Rom's spline; beyond it, its last rows go on.

    Between pixels a straight line would blur, the more the farther from both.
    """
    height, width = picture.shape
    x = min(max(x, 1.0), width - 2.001)
    y = min(max(y, 1.0), height - 2.001)
    col, row = int(x), int(y)
    u, v = x - col, y - row
    across = _spline(u)
    above, below = _line(picture, row - 1, col, across), _line(picture, row + 2, col, across)
    here, there = _line(picture, row, col, across), _line(picture, row + 1, col, across)
    b = _spline(v)
    value: float = b[0] * above + b[1] * here + b[2] * there + b[3] * below
    return value


@njit(inline="always")
def _line(picture: Array, row: int, col: int, a: tuple[float, float, float, float]) -> float:
    before, here = picture[row, col - 1], picture[row, col]
    there, after = picture[row, col + 1], picture[row, col + 2]
    total: float = a[0] * before + a[1] * here + a[2] * there + a[3] * after
    return total


@njit(inline="always")
def _spline(u: float) -> tuple[float, float, float, float]:
    """Shares of the four pixels around a place that is u after the second."""
    before = 0.5 * u * ((2.0 - u) * u - 1.0)
    here = 0.5 * (u * u * (3.0 * u - 5.0) + 2.0)
    there = 0.5 * u * ((4.0 - 3.0 * u) * u + 1.0)
    return before, here, there, 0.5 * u * u * (u - 1.0)
