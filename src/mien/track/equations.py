"""Normal equations of the residual, summed up pixel by pixel: J itself is never stored.

The residual is eps(p) = 1/2 sum w rho(I_t - I^) of P02 sec. 6.1.2, with a weight for each
pixel and a robust rho where P02 has the square; J = G + B of eq. (7), G by Sobel's gradient of the
pictures and the chain rule through projection, rotation and shape (app. B), B by those of single
expressions. What eq. (7) leaves to the reader: at a pixel that stays, a picture that moves to the
right brings what was to its left, so G takes the gradient with a minus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int
from mien.numeric.threads import for_row_bands
from mien.track.flows import POSE_UNKNOWNS, Flows, pose_flow
from mien.track.samples import Moved, Samples, look_up, sample_place

_BLOCKS = 8
"""Bands of rows that are summed up apart: the same sums, whatever the number of threads."""


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
        matrix: (N, N). vector: (N,), so that matrix @ step = vector lowers the residual.
        squares: sum of w rho(r) over the pixels. weight: sum of w.
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
    Source: that a Hessian may be kept, Baker and Matthews, Lucas-Kanade 20 years on, 2004.
    """
    height, width = samples.ids.shape
    sets, most = answers.sets.shape
    side = most if matrix else 0
    matrices, vectors = np.zeros((_BLOCKS, sets, side, side)), np.zeros((_BLOCKS, sets, most))
    totals = np.zeros((_BLOCKS, 2))
    inputs = (samples, moved, flows, answers)

    def blocks(first: int, end: int) -> None:
        _add_blocks(*inputs, first, end, matrices, vectors, totals)

    for_row_bands(blocks, _BLOCKS, work=2 * height * width)
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
    # Unpacked: to look at an array in a tuple, pixel by pixel, takes half as long again.
    ids, barycentrics, depth, drawn, target, weights, slopes, mean, along, scale = samples
    slopes = mean if matrices.shape[2] else slopes
    places, lens, step = moved
    face, t, (focal, cx, cy), counted = flows
    sets, sizes, set_of, region, direction, _, masks, triangles = answers
    pose, columns = np.empty((POSE_UNKNOWNS, 2)), np.empty(sets.shape[1])
    height, width = ids.shape
    tall = -(-height // len(totals))
    for row in range(first * tall, min(end * tall, height)):
        block = row // tall
        for col in range(width):
            weight = np.float64(weights[row, col])
            if weight == 0.0:
                continue
            f = ids[row, col]
            own = sets[set_of[f], : sizes[set_of[f]]]
            corners = (triangles[f, 0], triangles[f, 1], triangles[f, 2])
            b = barycentrics[row, col]
            x, y = (col + 0.5 - cx) / focal, (row + 0.5 - cy) / focal
            pose_flow(x, y, depth[row, col], t, focal, pose)
            _move(slopes[row, col], pose, face, corners, b, own, counted, columns)
            mixed = _mix(along[row, col], masks, corners, b, own, region, direction, step, columns)
            x, y = sample_place(corners, b, places, lens)
            r = look_up(target, x, y) - (drawn[row, col] + mixed)
            trust = 1.0 / (1.0 + r * r / (scale * scale))
            totals[block, 0] += weight * trust * r * r
            totals[block, 1] += weight
            weight *= trust * trust
            _add(columns, weight, r, matrices[block, set_of[f]], vectors[block, set_of[f]], own)


@njit(inline="always")
def _move(
    slope: Array,
    pose: Array,
    face: Array,
    corners: tuple[int, int, int],
    b: Array,
    own: Array,
    counted: Array,
    columns: Array,
) -> None:
    """Fill in how a pixel changes where its own unknowns move it: the pose's seven come first."""
    i, j, k = corners
    for p in range(POSE_UNKNOWNS):
        columns[p] = counted[p] * (slope[0] * pose[p, 0] + slope[1] * pose[p, 1])
    for a in range(POSE_UNKNOWNS, len(own)):
        n = own[a] - POSE_UNKNOWNS
        x = b[0] * face[i, n, 0] + b[1] * face[j, n, 0] + b[2] * face[k, n, 0]
        y = b[0] * face[i, n, 1] + b[1] * face[j, n, 1] + b[2] * face[k, n, 1]
        columns[a] = counted[own[a]] * (slope[0] * x + slope[1] * y)


@njit(inline="always")
def _mix(
    along: Array,
    masks: Array,
    corners: tuple[int, int, int],
    b: Array,
    own: Array,
    region: Array,
    direction: Array,
    step: Array,
    columns: Array,
) -> float:
    """Add how it changes where they change the mixture; by how much their step has changed it."""
    i, j, k = corners
    mixed = 0.0
    for a in range(len(own)):
        n = region[own[a]]
        if n >= 0:
            share = b[0] * masks[i, n] + b[1] * masks[j, n] + b[2] * masks[k, n]
            change = share * along[direction[own[a]]]
            columns[a] += change
            mixed += step[own[a]] * change
    return mixed


@njit(inline="always")
def _add(columns: Array, weight: float, r: float, matrix: Array, vector: Array, own: Array) -> None:
    for a in range(len(own)):
        part = weight * columns[a]
        vector[a] += part * r
        for b in range(min(a + 1, len(matrix))):
            matrix[a, b] += part * columns[b]
