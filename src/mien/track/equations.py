"""Normal equations of the residual, summed up pixel by pixel: J itself is never stored.

The residual is eps(p) = 1/2 sum w rho(I_t - I^) of P02 sec. 6.1.2, with a weight for each
pixel and a robust rho where P02 has the square; J = G + B of eq. (7), G by Sobel's gradient of the
pictures and the chain rule through projection, rotation and shape (app. B), B by those of single
expressions. What eq. (7) leaves to the reader: at a pixel that stays, a picture that moves to the
right brings what was to its left, so G takes the gradient with a minus.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int
from mien.numeric.threads import for_row_bands
from mien.track.drawing import Drawing, Pose
from mien.track.flows import POSE_UNKNOWNS, pose_flow
from mien.track.views import View

_BLOCKS = 8
"""Bands of rows that are summed up apart: the same sums, whatever the number of threads."""


class Comparison(NamedTuple):
    """A drawn picture beside the target.

    Attributes:
        drawn, target: (h, w) float32 luma, plain or filtered alike.
        weights: (h, w) float32 of the pixels.
        scale: grey levels. Geman and McClure's: a pixel that is off by it counts a quarter.
    """

    drawn: Float[Array, "h w"]
    target: Float[Array, "h w"]
    weights: Float[Array, "h w"]
    scale: float


class Answers(NamedTuple):
    """Which of the N unknowns, the pose's seven and then the face's, concern which pixels.

    Attributes:
        sets, sizes: (S, A) unknowns that concern the same triangles, in the first `sizes` (S,) of
            a row.
        set_of: (F,) which row is each triangle's.
        region: (N,) in which region the mixture of textures changes with it; -1 for none.
        direction: (N,) along which column of Q it does.
        Q: (K, L) float32, P02 eq. (4). masks: (V, R) float32 of the regions.
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


@dataclass(frozen=True)
class Equations:
    """J^T W J, J^T W r, and what the residual is.

    Attributes:
        matrix: (N, N). vector: (N,), so that matrix @ step = vector lowers the residual.
        squares: sum of w rho(r) over the pixels. weight: sum of w.
    """

    matrix: Float[Array, "n n"]
    vector: Float[Array, " n"]
    squares: float
    weight: float


def pose_equations(drawing: Drawing, comparison: Comparison, pose: Pose, view: View) -> Equations:
    """Of the seven unknowns of the pose, over the plain pictures."""
    height, width = drawing.ids.shape
    focal = view.focal * pose.zoom
    matrices = np.zeros((_BLOCKS, POSE_UNKNOWNS, POSE_UNKNOWNS))
    vectors, totals = np.zeros((_BLOCKS, POSE_UNKNOWNS)), np.zeros((_BLOCKS, 2))
    inputs = (drawing.ids, drawing.depth, comparison, pose.t, (focal, view.cx, view.cy))

    def add(block: int, first: int, end: int) -> None:
        _add_pose(*inputs, first, end, matrices[block], vectors[block], totals[block])

    _in_blocks(add, height, width)
    return _summed(matrices, vectors, totals)


def band_equations(
    drawing: Drawing,
    layers: Float[Array, "h w k"],
    comparison: Comparison,
    flows: Float[Array, "v n 2"],
    answers: Answers,
) -> Equations:
    """Of pose and face together, over band-pass filtered pictures.

    Args:
        layers: the expressions' pictures, filtered like the comparison's.
        flows: of flows.screen_flows.
        answers: which parameters concern which pixels.
    """
    height, width = drawing.ids.shape
    sets, most = answers.sets.shape
    matrices, vectors = np.zeros((_BLOCKS, sets, most, most)), np.zeros((_BLOCKS, sets, most))
    totals = np.zeros((_BLOCKS, 2))
    inputs = (drawing.ids, drawing.barycentrics, comparison, layers, flows, answers)

    def add(block: int, first: int, end: int) -> None:
        _add_bands(*inputs, first, end, matrices[block], vectors[block], totals[block])

    _in_blocks(add, height, width)
    count = flows.shape[1]
    matrix, vector = np.zeros((count, count)), np.zeros(count)
    _scatter(matrices, vectors, answers.sets, answers.sizes, matrix, vector)
    return _summed(matrix[None], vector[None], totals)


def _in_blocks(add: Callable[[int, int, int], None], height: int, width: int) -> None:
    """Call add(block, first_row, end_row) for every block of rows."""
    tall = -(-height // _BLOCKS)

    def blocks(first: int, end: int) -> None:
        for block in range(first, end):
            add(block, block * tall, min(block * tall + tall, height))

    for_row_bands(blocks, _BLOCKS, work=2 * height * width)


@njit(cache=True, nogil=True)
def _scatter(
    matrices: Array, vectors: Array, sets: Array, sizes: Array, matrix: Array, vector: Array
) -> None:
    """Add the sums of all blocks and sets to those of all unknowns."""
    for block in range(len(matrices)):
        for s in range(len(sets)):
            for a in range(sizes[s]):
                vector[sets[s, a]] += vectors[block, s, a]
                for b in range(a + 1):
                    matrix[sets[s, a], sets[s, b]] += matrices[block, s, a, b]


def _summed(matrices: Array, vectors: Array, totals: Array) -> Equations:
    half = matrices.sum(axis=0)
    matrix = half + np.tril(half, -1).T
    squares, weight = totals.sum(axis=0).tolist()
    return Equations(matrix, vectors.sum(axis=0), squares, weight)


@njit(inline="always")
def _sobel(picture: Array, row: int, col: int) -> tuple[float, float]:
    """How a picture changes at this pixel where the picture moves by a px: minus its gradient."""
    a, b = row - 1, row + 1
    left, right = col - 1, col + 1
    x = picture[a, right] + picture[b, right] - picture[a, left] - picture[b, left]
    y = picture[b, left] + picture[b, right] - picture[a, left] - picture[a, right]
    x += 2.0 * (picture[row, right] - picture[row, left])
    y += 2.0 * (picture[b, col] - picture[a, col])
    return -x / 8.0, -y / 8.0


@njit(inline="always")
def _gradient(drawn: Array, target: Array, row: int, col: int) -> tuple[float, float]:
    """The mean of both pictures' gradients: half the iterations that the drawn one's alone takes.

    Source: Benhimane and Malis, Real-time image-based tracking of planes using efficient
    second-order minimization, 2004.
    """
    drawn_x, drawn_y = _sobel(drawn, row, col)
    target_x, target_y = _sobel(target, row, col)
    return 0.5 * (drawn_x + target_x), 0.5 * (drawn_y + target_y)


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
def _add_pose(
    ids: Array,
    depth: Array,
    comparison: Comparison,
    t: Array,
    lens: tuple[float, float, float],
    first: int,
    end: int,
    matrix: Array,
    vector: Array,
    totals: Array,
) -> None:
    drawn, target, weights, scale = comparison
    focal, cx, cy = lens
    flow, column = np.empty((POSE_UNKNOWNS, 2)), np.empty(POSE_UNKNOWNS)
    for row in range(first, end):
        for col in range(ids.shape[1]):
            weight = weights[row, col]
            if weight == 0.0 or not _whole(ids, row, col):
                continue
            r = target[row, col] - drawn[row, col]
            gx, gy = _gradient(drawn, target, row, col)
            totals[1] += weight
            trust = 1.0 / (1.0 + r * r / (scale * scale))
            totals[0] += weight * trust * r * r
            weight *= trust * trust
            x, y = (col + 0.5 - cx) / focal, (row + 0.5 - cy) / focal
            pose_flow(x, y, depth[row, col], t, focal, flow)
            for p in range(POSE_UNKNOWNS):
                column[p] = gx * flow[p, 0] + gy * flow[p, 1]
                vector[p] += weight * r * column[p]
                for q in range(p + 1):
                    matrix[p, q] += weight * column[p] * column[q]


@njit(cache=True, nogil=True, fastmath=True)
def _add_bands(
    ids: Array,
    barycentrics: Array,
    comparison: Comparison,
    layers: Array,
    flows: Array,
    answers: Answers,
    first: int,
    end: int,
    matrices: Array,
    vectors: Array,
    totals: Array,
) -> None:
    drawn, target, weights, scale = comparison
    sets, sizes, set_of, region, direction, Q, masks, triangles = answers
    columns = np.empty(sets.shape[1])
    along = np.empty(Q.shape[1], np.float32)
    shares = np.empty(masks.shape[1], np.float32)
    for row in range(first, end):
        for col in range(ids.shape[1]):
            weight = np.float64(weights[row, col])
            if weight == 0.0 or not _whole(ids, row, col):
                continue
            t = ids[row, col]
            r = target[row, col] - drawn[row, col]
            gx, gy = _gradient(drawn, target, row, col)
            totals[1] += weight
            trust = 1.0 / (1.0 + r * r / (scale * scale))
            totals[0] += weight * trust * r * r
            weight *= trust * trust
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b0 = barycentrics[row, col, 0]
            b1 = barycentrics[row, col, 1]
            b2 = barycentrics[row, col, 2]
            # Eq. (7)'s sum over k of dw_k/dp I^_k, but for the region's share.
            for d in range(Q.shape[1]):
                along[d] = 0.0
                for n in range(Q.shape[0]):
                    along[d] += Q[n, d] * layers[row, col, n]
            for n in range(masks.shape[1]):
                shares[n] = b0 * masks[i, n] + b1 * masks[j, n] + b2 * masks[k, n]
            s = set_of[t]
            for a in range(sizes[s]):
                p = sets[s, a]
                x = b0 * flows[i, p, 0] + b1 * flows[j, p, 0] + b2 * flows[k, p, 0]
                y = b0 * flows[i, p, 1] + b1 * flows[j, p, 1] + b2 * flows[k, p, 1]
                columns[a] = gx * x + gy * y
                if region[p] >= 0:
                    columns[a] += shares[region[p]] * along[direction[p]]
            for a in range(sizes[s]):
                own = weight * columns[a]
                vectors[s, a] += own * r
                for b in range(a + 1):
                    matrices[s, a, b] += own * columns[b]
