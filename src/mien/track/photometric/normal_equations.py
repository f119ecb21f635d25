"""Normal equations of the residual, summed up pixel by pixel: J itself is never stored.

The residual is eps(p) = 1/2 sum w rho(I_t - I^) of [Pighin 2002] sec. 6.1.2, with a weight for each
pixel and a robust rho where [Pighin 2002] has the square; J = G + B of eq. (7), G by Sobel's
gradient of the pictures and the chain rule through projection, rotation and shape (app. B), B by
those of single expressions. What eq. (7) leaves to the reader: at a pixel that stays, a picture
that moves to the right brings what was to its left, so G takes the gradient with a minus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, Flows, pose_flow
from mien.track.photometric.samples import Answers, Moved, Samples, look_up

_CHUNK = 256
"""Samples that are worked on together: their columns stay in the nearest cache."""
Part = tuple[int, int]
"""Their first, and how many they are."""
_BLOCK = 2000
"""Samples, about, that are summed up apart: the same sums, whatever the number of threads."""


def pose_answers(triangles: Int[Array, "f 3"]) -> Answers:
    """Of the pose alone, which concerns every pixel and mixes nothing.

    Args:
        triangles: of Answers.
    """
    none = np.full(POSE_UNKNOWNS, -1, np.int32)
    return Answers(
        sets=np.arange(POSE_UNKNOWNS, dtype=np.int32)[None],
        sizes=np.array([POSE_UNKNOWNS], np.int32),
        set_of=np.zeros(len(triangles), np.int32),
        region=none,
        direction=none,
        Q=np.empty((0, 0), np.float32),
        masks=np.empty((len(triangles), 0), np.float32),
        triangles=triangles,
    )


@dataclass(frozen=True)
class Equations:
    """J^T W J, J^T W r, and what the residual is.

    Attributes:
        matrix: (N, N).
        vector: (N,), so that matrix @ step = vector lowers the residual.
        squares: sum of w rho(r) over the pixels.
        weight: sum of w.
    """

    matrix: Float[Array, "n n"]
    vector: Float[Array, " n"]
    squares: float
    weight: float


def sum_up(
    samples: Samples,
    moved: Moved,
    flows: Flows,
    answers: Answers,
    *,
    matrix: bool = True,
) -> Equations:
    """Equations of the unknowns where a guess puts the samples.

    Args:
        flows: where the unknowns move them.
        answers: which unknowns concern which samples.
        matrix: where the samples were drawn, for the first step; False: leave J^T W J at 0, it is
            next to the same near by.

    Source:
        that a Hessian may be kept, Baker and Matthews, Lucas-Kanade 20 years on, 2004.
    """
    sets, most = answers.sets.shape
    side = most if matrix else 0
    parts = -(-len(samples.drawn) // _BLOCK)
    matrices, vectors = np.zeros((parts, sets, side, side)), np.zeros((parts, sets, most))
    totals = np.zeros((parts, 2))
    inputs = (samples, moved, flows, answers)

    def blocks(first: int, end: int) -> None:
        _add_blocks(*inputs, first, end, matrices, vectors, totals)

    for_row_bands(blocks, parts, work=5 * len(samples.drawn))
    count = len(answers.region)
    half, vector = np.zeros((count, count)), np.zeros(count)
    _scatter(matrices, vectors, answers.sets, answers.sizes, half, vector)
    squares, weight = totals.sum(axis=0).tolist()
    return Equations(half + np.tril(half, -1).T, vector, squares, weight)


@njit(cache=True, nogil=True)
def _scatter(
    matrices: Array, vectors: Array, sets: Array, sizes: Array, half: Array, vector: Array
) -> None:
    """Add the sums of all blocks and sets to those of all unknowns."""
    for block in range(len(vectors)):
        for s in range(len(sets)):
            for a in range(sizes[s]):
                vector[sets[s, a]] += vectors[block, s, a]
                for b in range(min(a + 1, matrices.shape[2])):
                    half[sets[s, a], sets[s, b]] += matrices[block, s, a, b]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _add_blocks(
    samples: Samples,
    moved: Moved,
    flows: Flows,
    answers: Answers,
    first: int,
    end: int,
    matrices: Array,
    vectors: Array,
    totals: Array,
) -> None:
    most, starts = answers.sets.shape[1], samples.starts
    columns = np.empty((most, _CHUNK), np.float32)
    place = (np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32))
    r, weights = np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32)
    slopes = samples.first if matrices.shape[2] else samples.slopes
    for block in range(first, end):
        for s in range(len(answers.sets)):
            own = answers.sets[s, : answers.sizes[s]]
            count = starts[s + 1] - starts[s]
            span = [starts[s] + count * edge // len(totals) for edge in (block, block + 1)]
            for a in range(span[0], span[1], _CHUNK):
                part = (a, min(_CHUNK, span[1] - a))
                _move_with_pose(samples, slopes, flows, part, columns)
                _move_rigidly(samples, moved, part, *place)
                _move_with_face(samples, slopes, flows, own, moved.step, part, columns, *place)
                _mix(samples, answers, own, moved.step, part, columns, r)
                _compare(samples.target, part, *place, r)
                _weigh(samples, part, r, weights, totals[block])
                _add(columns, own, r, weights, part, matrices[block, s], vectors[block, s])


@njit(nogil=True, fastmath=True, error_model="numpy")
def _move_with_pose(
    samples: Samples, slopes: Array, flows: Flows, part: Part, columns: Array
) -> None:
    """Fill in how samples change where the pose's unknowns move them."""
    first, count = part
    x, y, z = samples.x[first:], samples.y[first:], samples.z[first:]
    gx, gy = slopes[0][first:], slopes[1][first:]
    t = (np.float32(flows.t[0]), np.float32(flows.t[1]), np.float32(flows.t[2]))
    focal = np.float32(flows.lens[0])
    for n in range(count):
        flow = pose_flow(x[n], y[n], z[n], t, focal)
        columns[0, n] = gx[n] * flow[0][0] + gy[n] * flow[0][1]
        columns[1, n] = gx[n] * flow[1][0] + gy[n] * flow[1][1]
        columns[2, n] = gx[n] * flow[2][0] + gy[n] * flow[2][1]
        columns[3, n] = gx[n] * flow[3][0] + gy[n] * flow[3][1]
        columns[4, n] = gx[n] * flow[4][0] + gy[n] * flow[4][1]
        columns[5, n] = gx[n] * flow[5][0] + gy[n] * flow[5][1]
        columns[6, n] = gx[n] * flow[6][0] + gy[n] * flow[6][1]
    for p in range(POSE_UNKNOWNS):
        columns[p] *= flows.counted[p]


@njit(nogil=True, fastmath=True, error_model="numpy")
def _move_rigidly(samples: Samples, moved: Moved, part: Part, cols: Array, rows: Array) -> None:
    """Fill in where samples are now, were the face rigid: the first pixel's centre is at 0, 0."""
    first, count = part
    x, y, z = samples.x[first:], samples.y[first:], samples.z[first:]
    R, t = moved.turn.astype(np.float32), moved.shift.astype(np.float32)
    focal = np.float32(moved.lens[0])
    cx, cy = np.float32(moved.lens[1] - 0.5), np.float32(moved.lens[2] - 0.5)
    for n in range(count):
        X, Y, Z = x[n] * z[n], y[n] * z[n], z[n]
        scale = focal / (R[2, 0] * X + R[2, 1] * Y + R[2, 2] * Z + t[2])
        cols[n] = scale * (R[0, 0] * X + R[0, 1] * Y + R[0, 2] * Z + t[0]) + cx
        rows[n] = scale * (R[1, 0] * X + R[1, 1] * Y + R[1, 2] * Z + t[1]) + cy


@njit(nogil=True, fastmath=True, error_model="numpy")
def _move_with_face(
    samples: Samples,
    slopes: Array,
    flows: Flows,
    own: Array,
    step: Array,
    part: Part,
    columns: Array,
    cols: Array,
    rows: Array,
) -> None:
    """Fill in the columns of the face's unknowns; add by how much their step moves the samples."""
    first, count = part
    gx, gy = slopes[0][first:], slopes[1][first:]
    corners, barycentrics = samples.corners[first:], samples.barycentrics[first:]
    face, counted, by = flows.face, flows.counted, step.astype(np.float32)
    for n in range(count):
        i, j, k = corners[n, 0], corners[n, 1], corners[n, 2]
        b0, b1, b2 = barycentrics[n, 0], barycentrics[n, 1], barycentrics[n, 2]
        for a in range(POSE_UNKNOWNS, len(own)):
            p = np.uint32(own[a] - POSE_UNKNOWNS)
            u = b0 * face[i, p, 0] + b1 * face[j, p, 0] + b2 * face[k, p, 0]
            v = b0 * face[i, p, 1] + b1 * face[j, p, 1] + b2 * face[k, p, 1]
            columns[a, n] = counted[own[a]] * (gx[n] * u + gy[n] * v)
            cols[n] += by[own[a]] * u
            rows[n] += by[own[a]] * v


@njit(nogil=True, fastmath=True, error_model="numpy")
def _mix(
    samples: Samples,
    answers: Answers,
    own: Array,
    step: Array,
    part: Part,
    columns: Array,
    drawn: Array,
) -> None:
    """Add how samples change where unknowns change the mixture; fill in what their step drew."""
    first, count = part
    drawn[:count] = samples.drawn[first : first + count]
    for a in range(len(own)):
        if answers.region[own[a]] >= 0:
            shares = samples.shares[answers.region[own[a]]][first:]
            along = samples.along[answers.direction[own[a]]][first:]
            by = np.float32(step[own[a]])
            for n in range(count):
                change = shares[n] * along[n]
                columns[a, n] += change
                drawn[n] += by * change


@njit(nogil=True, fastmath=True, error_model="numpy")
def _compare(target: Array, part: Part, cols: Array, rows: Array, r: Array) -> None:
    """The target at these places, less what was in r."""
    height, width = target.shape
    flat = target.reshape(height * width)
    for n in range(part[1]):
        r[n] = look_up(flat, width, height, cols[n], rows[n]) - r[n]


@njit(nogil=True, fastmath=True, error_model="numpy")
def _weigh(samples: Samples, part: Part, r: Array, weights: Array, totals: Array) -> None:
    """Fill in robust weights; add up w rho(r) and w."""
    first, count = part
    given, one = samples.weights[first:], np.float32(1)
    inverse = np.float32(1 / samples.scale**2)
    squares = total = np.float32(0)
    for n in range(count):
        trust = one / (one + r[n] * r[n] * inverse)
        weights[n] = given[n] * trust * trust
        squares += given[n] * trust * r[n] * r[n]
        total += given[n]
    totals[0] += squares
    totals[1] += total


@njit(nogil=True, fastmath=True, error_model="numpy")
def _add(
    columns: Array, own: Array, r: Array, weights: Array, part: Part, matrix: Array, vector: Array
) -> None:
    count = part[1]
    for a in range(len(own)):
        one = columns[a]
        total = np.float32(0)
        for n in range(count):
            total += one[n] * weights[n] * r[n]
        vector[a] += total
    for a in range(min(len(own), len(matrix))):
        one = columns[a]
        for b in range(a + 1):
            other = columns[b]
            total = np.float32(0)
            for n in range(count):
                total += one[n] * weights[n] * other[n]
            matrix[a, b] += total
