"""What a drawing shows of the face, pixel by pixel, and where later guesses put it in the frame.

A face is drawn once on each size. A guess near by moves what was drawn: every pixel goes where the
guess puts its place on the head, and is compared with the frame there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.image.drawing import Drawing, Lens


class Answers(NamedTuple):
    """Which of the N unknowns, the pose's seven and then the face's, concern which pixels.

    Attributes:
        sets: (S, A) unknowns that concern the same triangles, in the first `sizes` (S,) of a row;
            the pose's come first.
        sizes: as `sets`.
        set_of: (F,) which row is each triangle's.
        region: (N,) in which region the mixture of textures changes with it; -1 for none.
        direction: (N,) along which column of Q it does.
        Q: (K, L) float32, [Pighin 2002] eq. (4).
        masks: (V, R) float32 of the regions.
        triangles: (F, 3) vertex indices.
    """

    sets: Int[Array, "s a"]
    sizes: Int[Array, " s"]
    set_of: Int[Array, " f"]
    region: Int[Array, " n"]
    direction: Int[Array, " n"]
    Q: Float[Array, "k l"]
    masks: Float[Array, "v r"]
    triangles: Int[Array, "f 3"]


class Samples(NamedTuple):
    """The N pixels that are compared, those of one set of Answers after those of another.

    Attributes:
        starts: (S + 1,) each set's first.
        corners: (N, 3) vertices of its triangle.
        barycentrics: (N, 3) float32.
        x: (N,) float32 X/Z, Y/Z and Z mm, camera space, where it was drawn.
        y: (N,) float32 X/Z, Y/Z and Z mm, camera space, where it was drawn.
        z: (N,) float32 X/Z, Y/Z and Z mm, camera space, where it was drawn.
        drawn: (N,) float32 luma, plain or filtered.
        weights: (N,) float32.
        slopes: (2, N) float32: how drawn changes at a pixel where it moves by a px to the right,
            and down.
        first: the mean of drawn's and the target's, for the step from where samples were drawn.
        along: (L, N) float32: how drawn changes with each direction of the mixture, were it
            everywhere.
        shares: (R, N) float32 of the regions in the pixel.
        target: (h, w) float32 luma of the frame, plain or filtered alike.
        scale: grey levels. Geman and McClure's: a pixel that is off by it counts a quarter.
    """

    starts: Int[Array, " s"]
    corners: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]
    x: Float[Array, " n"]
    y: Float[Array, " n"]
    z: Float[Array, " n"]
    drawn: Float[Array, " n"]
    weights: Float[Array, " n"]
    slopes: Float[Array, "2 n"]
    first: Float[Array, "2 n"]
    along: Float[Array, "l n"]
    shares: Float[Array, "r n"]
    target: Float[Array, "h w"]
    scale: float


def take_samples(
    drawing: Drawing,
    layers: Float[Array, "h w k"],
    drawn: Float[Array, "h w"],
    target: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    answers: Answers,
    lens: Lens,
    *,
    scale: float,
) -> Samples:
    """Samples of a drawing.

    Args:
        layers: the expressions' pictures, plain or filtered.
        drawn: luma, likewise.
        target: luma, likewise.
        weights: of the pixels.
        lens: of the drawing.
        scale: of Samples.
    """
    height, width = drawing.ids.shape
    weights = _inside(weights, drawing.ids)
    counts = np.zeros((height, len(answers.sets)), np.int64)
    for_row_bands(
        lambda a, b: _count_rows(drawing.ids, weights, answers.set_of, a, b, counts),
        height,
        work=width * height // 2,
    )
    # Where in the order of sets, and in a set of rows, each row's own begin.
    ends = np.cumsum(counts.T).reshape(counts.T.shape).T
    begins = ends - counts
    samples = _empty(np.append(begins[0], counts.sum()), answers, target, scale)
    inputs = (drawing, drawn, weights, layers, answers, lens, begins)
    for_row_bands(
        lambda a, b: _sample_rows(*inputs, a, b, samples), height, work=2 * width * height
    )
    return samples


def _empty(
    starts: Int[Array, " s"], answers: Answers, target: Float[Array, "h w"], scale: float
) -> Samples:
    total = int(starts[-1])
    x, y, z, drawn, weights = np.empty((5, total), np.float32)
    slopes, mean = np.empty((2, 2, total), np.float32)
    return Samples(
        starts,
        np.empty((total, 3), np.uint32),
        np.empty((total, 3), np.float32),
        *(x, y, z),
        *(drawn, weights),
        *(slopes, mean),
        np.empty((answers.Q.shape[1], total), np.float32),
        np.empty((answers.masks.shape[1], total), np.float32),
        target,
        scale,
    )


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


def _inside(weights: Float[Array, "h w"], ids: Int[Array, "h w"]) -> Float[Array, "h w"]:
    """The weights, 0 where a pixel or one of the eight around it does not show the face.

    At the outline there is no gradient, and a frame's pixel mixes the face with what is behind it.
    """
    import cv2

    whole = cv2.erode(np.uint8(ids >= 0), np.ones((3, 3), np.uint8), borderValue=0)
    return weights * whole


@njit(cache=True, nogil=True)
def _count_rows(
    ids: Array, weights: Array, set_of: Array, first: int, end: int, counts: Array
) -> None:
    for row in range(first, end):
        for col in range(ids.shape[1]):
            if weights[row, col] > 0:
                counts[row, set_of[ids[row, col]]] += 1


@njit(cache=True, nogil=True, fastmath=True)
def _sample_rows(
    drawing: Drawing,
    drawn: Array,
    weights: Array,
    layers: Array,
    answers: Answers,
    lens: Lens,
    begins: Array,
    first: int,
    end: int,
    samples: Samples,
) -> None:
    """Fill in the samples of some rows of the drawing.

    The mean of both pictures' slopes takes half the iterations that the drawn one's alone take:
    Benhimane and Malis, Real-time image-based tracking of planes using efficient second-order
    minimization, 2004. It is of no use where samples have moved, for there the target's is another.
    """
    half = np.float32(0.5)
    # Unpacked: to look at an array in a tuple, pixel by pixel, takes half as long again.
    ids, barycentrics, depth = drawing.ids, drawing.barycentrics, drawing.depth
    Q, masks, triangles, set_of = answers.Q, answers.masks, answers.triangles, answers.set_of
    focal, cx, cy = lens
    _, corners, inside, xs, ys, zs, luma, counted, slopes, mean, along, shares, target, _ = samples
    for row in range(first, end):
        begin = begins[row].copy()
        for col in range(ids.shape[1]):
            if weights[row, col] == 0:
                continue
            t = ids[row, col]
            n = begin[set_of[t]]
            begin[set_of[t]] += 1
            xs[n], ys[n] = (col + 0.5 - cx) / focal, (row + 0.5 - cy) / focal
            zs[n] = depth[row, col]
            luma[n], counted[n] = drawn[row, col], weights[row, col]
            slopes[0, n], slopes[1, n] = _sobel(drawn, row, col)
            x, y = _sobel(target, row, col)
            mean[0, n], mean[1, n] = half * (x + slopes[0, n]), half * (y + slopes[1, n])
            for corner in range(3):
                corners[n, corner] = triangles[t, corner]
                inside[n, corner] = barycentrics[row, col, corner]
            # Eq. (7)'s sum over k of dw_k/dp I^_k, but for the region's share.
            for d in range(Q.shape[1]):
                change = np.float32(0)
                for k in range(Q.shape[0]):
                    change += Q[k, d] * layers[row, col, k]
                along[d, n] = change
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b = barycentrics[row, col]
            for r in range(masks.shape[1]):
                shares[r, n] = b[0] * masks[i, r] + b[1] * masks[j, r] + b[2] * masks[k, r]


class Moved(NamedTuple):
    """Where a guess puts what was drawn.

    Attributes:
        turn: (3, 3), shift: (3,) mm: turn @ place + shift, in camera space, were the face rigid.
        lens: of the guess.
        step: (N,) the unknowns less those that were drawn.
    """

    turn: Float[Array, "3 3"]
    shift: Float[Array, " 3"]
    lens: Lens
    step: Float[Array, " n"]


@njit(inline="always")
def look_up(picture: Array, width: int, height: int, x: float, y: float) -> np.float32:
    """A picture between its pixels, by Catmull and Rom's spline; beyond it, its last rows go on.

    Between pixels a straight line would blur, the more the farther from both.

    Args:
        picture: (H * W,) float32, row after row.
        x: px, the first one's centre at 0, 0.
        y: px, the first one's centre at 0, 0.
    """
    x, y = min(max(x, 1.0), width - 2.001), min(max(y, 1.0), height - 2.001)
    col, row = int(x), int(y)
    a, b = _spline(np.float32(x - col)), _spline(np.float32(y - row))
    # Unsigned: numbers that may be negative would be looked at one by one.
    one, step = np.uint64(1), np.uint64(width)
    n0 = np.uint64((row - 1) * width + col - 1)
    n1, n2, n3 = n0 + step, n0 + step + step, n0 + step + step + step
    total: np.float32 = 0 * b[0]
    for share in a:
        below = b[0] * picture[n0] + b[1] * picture[n1] + b[2] * picture[n2] + b[3] * picture[n3]
        total += share * below
        n0, n1, n2, n3 = n0 + one, n1 + one, n2 + one, n3 + one
    return total


@njit(inline="always")
def _spline(u: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Shares of the four pixels around a place that is u after the second."""
    half, one, two = np.float32(0.5), np.float32(1), np.float32(2)
    three, four, five = np.float32(3), np.float32(4), np.float32(5)
    before = half * u * ((two - u) * u - one)
    here = half * (u * u * (three * u - five) + two)
    there = half * u * ((four - three * u) * u + one)
    return before, here, there, half * u * u * (u - one)
