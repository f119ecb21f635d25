"""Normal equations of the photometric residual, accumulated pixel by pixel; J is never stored.

The cost is eps(p) = 1/2 sum w rho(I_t - I^) of [Pighin 2002] sec. 6.1.2, with a weight for each
pixel and a robust rho where [Pighin 2002] has the square. J = G + B of eq. (7): G by Sobel's
gradient of the pictures and the chain rule through projection, rotation and shape (app. B), B by
the pictures of single expressions. G has the gradient with a minus, which eq. (7) does not show:
a picture that moves to the right brings to a pixel what was to its left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, ImageJacobian, pose_jacobian
from mien.track.photometric.samples import ParameterSupport, Samples, Warp, sample_bicubic

_CHUNK = 256
"""Samples that are processed together, so that their columns stay in the first-level cache."""
_Chunk = tuple[int, int]
"""First sample of a chunk, and how many there are."""
_BLOCK = 2000
"""About how many samples have sums of their own: results do not depend on the number of threads."""


def pose_support(triangles: Int[Array, "f 3"]) -> ParameterSupport:
    """Support of the pose alone, which affects every pixel and no blending weight.

    Args:
        triangles: of ParameterSupport.
    """
    none = np.full(POSE_UNKNOWNS, -1, np.int32)
    return ParameterSupport(
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
class NormalEquations:
    """J^T W J, J^T W r, and the residual.

    Attributes:
        matrix: (N, N).
        vector: (N,); the Gauss-Newton step solves matrix @ step = vector.
        squares: sum of w rho(r) over the pixels.
        weight: sum of w.
    """

    matrix: Float[Array, "n n"]
    vector: Float[Array, " n"]
    squares: float
    weight: float


def accumulate_normal_equations(
    samples: Samples,
    warp: Warp,
    jacobian: ImageJacobian,
    support: ParameterSupport,
    *,
    matrix: bool = True,
) -> NormalEquations:
    """Normal equations of all unknowns at warped samples.

    Args:
        samples: of the drawn face.
        warp: where they are compared with the frame.
        jacobian: of image points by the unknowns.
        support: which unknowns affect which samples.
        matrix: True for the first step, where the samples were drawn. False leaves J^T W J at 0:
            near by it is nearly the same.

    Source:
        the constant Hessian: Baker and Matthews, Lucas-Kanade 20 years on, 2004.
    """
    sets, most = support.sets.shape
    side = most if matrix else 0
    parts = -(-len(samples.drawn) // _BLOCK)
    matrices, vectors = np.zeros((parts, sets, side, side)), np.zeros((parts, sets, most))
    totals = np.zeros((parts, 2))
    inputs = (samples, warp, jacobian, support)

    def blocks(first: int, end: int) -> None:
        _add_blocks(*inputs, first, end, matrices, vectors, totals)

    for_row_bands(blocks, parts, work=5 * len(samples.drawn))
    count = len(support.region)
    half, vector = np.zeros((count, count)), np.zeros(count)
    _scatter(matrices, vectors, support.sets, support.sizes, half, vector)
    squares, weight = totals.sum(axis=0).tolist()
    return NormalEquations(half + np.tril(half, -1).T, vector, squares, weight)


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
    warp: Warp,
    jacobian: ImageJacobian,
    support: ParameterSupport,
    first: int,
    end: int,
    matrices: Array,
    vectors: Array,
    totals: Array,
) -> None:
    most, starts = support.sets.shape[1], samples.starts
    columns = np.empty((most, _CHUNK), np.float32)
    pixels = (np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32))
    r, weights = np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32)
    slopes = samples.mean_slopes if matrices.shape[2] else samples.slopes
    for block in range(first, end):
        for s in range(len(support.sets)):
            own = support.sets[s, : support.sizes[s]]
            count = starts[s + 1] - starts[s]
            span = [starts[s] + count * edge // len(totals) for edge in (block, block + 1)]
            for a in range(span[0], span[1], _CHUNK):
                chunk = (a, min(_CHUNK, span[1] - a))
                _pose_columns(samples, slopes, jacobian, chunk, columns)
                _warp_rigidly(samples, warp, chunk, *pixels)
                _face_columns(samples, slopes, jacobian, own, warp.step, chunk, columns, *pixels)
                _mixture_columns(samples, support, own, warp.step, chunk, columns, r)
                _residuals(samples.target, chunk, *pixels, r)
                _robust_weights(samples, chunk, r, weights, totals[block])
                _add_products(
                    columns, own, r, weights, chunk, matrices[block, s], vectors[block, s]
                )


@njit(nogil=True, fastmath=True, error_model="numpy")
def _pose_columns(
    samples: Samples, slopes: Array, jacobian: ImageJacobian, chunk: _Chunk, columns: Array
) -> None:
    """Fill in the columns of J of the pose's unknowns."""
    first, count = chunk
    x, y, z = samples.x[first:], samples.y[first:], samples.z[first:]
    gx, gy = slopes[0][first:], slopes[1][first:]
    t = (np.float32(jacobian.t[0]), np.float32(jacobian.t[1]), np.float32(jacobian.t[2]))
    focal = np.float32(jacobian.intrinsics.focal)
    for n in range(count):
        by_pose = pose_jacobian(x[n], y[n], z[n], t, focal)
        columns[0, n] = gx[n] * by_pose[0][0] + gy[n] * by_pose[0][1]
        columns[1, n] = gx[n] * by_pose[1][0] + gy[n] * by_pose[1][1]
        columns[2, n] = gx[n] * by_pose[2][0] + gy[n] * by_pose[2][1]
        columns[3, n] = gx[n] * by_pose[3][0] + gy[n] * by_pose[3][1]
        columns[4, n] = gx[n] * by_pose[4][0] + gy[n] * by_pose[4][1]
        columns[5, n] = gx[n] * by_pose[5][0] + gy[n] * by_pose[5][1]
        columns[6, n] = gx[n] * by_pose[6][0] + gy[n] * by_pose[6][1]
    for p in range(POSE_UNKNOWNS):
        columns[p] *= jacobian.active[p]


@njit(nogil=True, fastmath=True, error_model="numpy")
def _warp_rigidly(samples: Samples, warp: Warp, chunk: _Chunk, cols: Array, rows: Array) -> None:
    """Fill in where the rigid motion moves the samples, px; 0, 0 is the first pixel's centre."""
    first, count = chunk
    x, y, z = samples.x[first:], samples.y[first:], samples.z[first:]
    R, t = warp.R.astype(np.float32), warp.t.astype(np.float32)
    focal = np.float32(warp.intrinsics.focal)
    cx, cy = np.float32(warp.intrinsics.cx - 0.5), np.float32(warp.intrinsics.cy - 0.5)
    for n in range(count):
        X, Y, Z = x[n] * z[n], y[n] * z[n], z[n]
        scale = focal / (R[2, 0] * X + R[2, 1] * Y + R[2, 2] * Z + t[2])
        cols[n] = scale * (R[0, 0] * X + R[0, 1] * Y + R[0, 2] * Z + t[0]) + cx
        rows[n] = scale * (R[1, 0] * X + R[1, 1] * Y + R[1, 2] * Z + t[1]) + cy


@njit(nogil=True, fastmath=True, error_model="numpy")
def _face_columns(
    samples: Samples,
    slopes: Array,
    jacobian: ImageJacobian,
    own: Array,
    step: Array,
    chunk: _Chunk,
    columns: Array,
    cols: Array,
    rows: Array,
) -> None:
    """Fill in the columns of the face's unknowns; add the samples' motion by their step."""
    first, count = chunk
    gx, gy = slopes[0][first:], slopes[1][first:]
    corners, barycentrics = samples.corners[first:], samples.barycentrics[first:]
    face, active, by = jacobian.face, jacobian.active, step.astype(np.float32)
    for n in range(count):
        i, j, k = corners[n, 0], corners[n, 1], corners[n, 2]
        b0, b1, b2 = barycentrics[n, 0], barycentrics[n, 1], barycentrics[n, 2]
        for a in range(POSE_UNKNOWNS, len(own)):
            p = np.uint32(own[a] - POSE_UNKNOWNS)
            u = b0 * face[i, p, 0] + b1 * face[j, p, 0] + b2 * face[k, p, 0]
            v = b0 * face[i, p, 1] + b1 * face[j, p, 1] + b2 * face[k, p, 1]
            columns[a, n] = active[own[a]] * (gx[n] * u + gy[n] * v)
            cols[n] += by[own[a]] * u
            rows[n] += by[own[a]] * v


@njit(nogil=True, fastmath=True, error_model="numpy")
def _mixture_columns(
    samples: Samples,
    support: ParameterSupport,
    own: Array,
    step: Array,
    chunk: _Chunk,
    columns: Array,
    drawn: Array,
) -> None:
    """Add the change of the mixture to the columns; fill in the luma after the step."""
    first, count = chunk
    drawn[:count] = samples.drawn[first : first + count]
    for a in range(len(own)):
        if support.region[own[a]] >= 0:
            region_weights = samples.region_weights[support.region[own[a]]][first:]
            mixture_slopes = samples.mixture_slopes[support.direction[own[a]]][first:]
            by = np.float32(step[own[a]])
            for n in range(count):
                change = region_weights[n] * mixture_slopes[n]
                columns[a, n] += change
                drawn[n] += by * change


@njit(nogil=True, fastmath=True, error_model="numpy")
def _residuals(target: Array, chunk: _Chunk, cols: Array, rows: Array, r: Array) -> None:
    """Replace the luma in r by the target at these pixels less it."""
    height, width = target.shape
    flat = target.reshape(height * width)
    for n in range(chunk[1]):
        r[n] = sample_bicubic(flat, width, height, cols[n], rows[n]) - r[n]


@njit(nogil=True, fastmath=True, error_model="numpy")
def _robust_weights(
    samples: Samples, chunk: _Chunk, r: Array, weights: Array, totals: Array
) -> None:
    """Fill in Geman and McClure's weights; add up w rho(r) and w."""
    first, count = chunk
    given, one = samples.weights[first:], np.float32(1)
    inverse = np.float32(1 / samples.scale**2)
    squares = total = np.float32(0)
    for n in range(count):
        robust = one / (one + r[n] * r[n] * inverse)
        weights[n] = given[n] * robust * robust
        squares += given[n] * robust * r[n] * r[n]
        total += given[n]
    totals[0] += squares
    totals[1] += total


@njit(nogil=True, fastmath=True, error_model="numpy")
def _add_products(
    columns: Array,
    own: Array,
    r: Array,
    weights: Array,
    chunk: _Chunk,
    matrix: Array,
    vector: Array,
) -> None:
    count = chunk[1]
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
