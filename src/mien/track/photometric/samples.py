"""Pixels of a drawn face, and how other parameters warp them in the frame.

A face is drawn once on each pyramid level. Other parameters near by move what was drawn: every
pixel goes where they project its point of the head, and is compared with the frame there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.image.drawing import Drawing
from mien.track.image.frame_pyramid import Intrinsics


class ParameterSupport(NamedTuple):
    """Which of the N unknowns, the pose's seven and then the face's, affect which triangles.

    Attributes:
        sets: (S, A) unknowns that affect the same triangles, in the first `sizes` of each row; the
            pose's come first.
        sizes: (S,) how many unknowns are in each set.
        set_of: (F,) the set of each triangle.
        region: (N,) in which region an unknown changes the mixture of textures; -1 for none.
        direction: (N,) by which column of Q it does.
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
    """The N pixels that are compared, ordered by the set of their ParameterSupport.

    Attributes:
        starts: (S + 1,) each set's first.
        corners: (N, 3) vertices of its triangle.
        barycentrics: (N, 3) float32.
        x: (N,) float32 X/Z, camera space, where it was drawn.
        y: (N,) float32 Y/Z.
        z: (N,) float32 Z, mm.
        drawn: (N,) float32 luma, plain or filtered.
        weights: (N,) float32.
        slopes: (2, N) float32, minus the gradient of `drawn`: the change at a pixel when the
            picture moves by a px to the right, and down.
        mean_slopes: (2, N) the mean of drawn's and the target's, for the step from where samples
            were drawn.
        mixture_slopes: (L, N) float32: the change of `drawn` with each column of Q, if it applied
            to the whole face.
        region_weights: (R, N) float32: the regions' masks at the pixel.
        target: (h, w) float32 luma of the frame, plain or filtered like `drawn`.
        scale: grey levels, of Geman and McClure's robust weights: 1/4 at a residual of this size.
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
    mean_slopes: Float[Array, "2 n"]
    mixture_slopes: Float[Array, "l n"]
    region_weights: Float[Array, "r n"]
    target: Float[Array, "h w"]
    scale: float


def take_samples(
    drawing: Drawing,
    layers: Float[Array, "h w k"],
    drawn: Float[Array, "h w"],
    target: Float[Array, "h w"],
    weights: Float[Array, "h w"],
    support: ParameterSupport,
    intrinsics: Intrinsics,
    *,
    scale: float,
) -> Samples:
    """Samples of a drawing.

    Args:
        drawing: of the face.
        layers: the expressions' pictures, plain or filtered.
        drawn: luma, likewise.
        target: luma, likewise.
        weights: of the pixels.
        support: which unknowns affect which triangles.
        intrinsics: of the drawing's camera.
        scale: of Samples.
    """
    height, width = drawing.ids.shape
    weights = _without_outline(weights, drawing.ids)
    counts = np.zeros((height, len(support.sets)), np.int64)
    for_row_bands(
        lambda a, b: _count_rows(drawing.ids, weights, support.set_of, a, b, counts),
        height,
        work=width * height // 2,
    )
    # Where in the order of sets, and in a set of rows, each row's own begin.
    ends = np.cumsum(counts.T).reshape(counts.T.shape).T
    begins = ends - counts
    samples = _empty(np.append(begins[0], counts.sum()), support, target, scale)
    inputs = (drawing, drawn, weights, layers, support, intrinsics, begins)
    for_row_bands(
        lambda a, b: _sample_rows(*inputs, a, b, samples), height, work=2 * width * height
    )
    return samples


def _empty(
    starts: Int[Array, " s"], support: ParameterSupport, target: Float[Array, "h w"], scale: float
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
        np.empty((support.Q.shape[1], total), np.float32),
        np.empty((support.masks.shape[1], total), np.float32),
        target,
        scale,
    )


@njit(inline="always")
def _sobel(picture: Array, row: int, col: int) -> tuple[float, float]:
    """Minus the gradient: the change at this pixel when the picture moves by a px."""
    a, b = row - 1, row + 1
    left, right = col - 1, col + 1
    x = picture[a, right] + picture[b, right] - picture[a, left] - picture[b, left]
    y = picture[b, left] + picture[b, right] - picture[a, left] - picture[a, right]
    x += np.float32(2.0) * (picture[row, right] - picture[row, left])
    y += np.float32(2.0) * (picture[b, col] - picture[a, col])
    return -x / np.float32(8.0), -y / np.float32(8.0)


def _without_outline(weights: Float[Array, "h w"], ids: Int[Array, "h w"]) -> Float[Array, "h w"]:
    """The weights, 0 where a pixel or one of the eight around it does not show the face.

    At the outline there is no gradient, and a pixel of the frame mixes face and background.
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
    support: ParameterSupport,
    intrinsics: Intrinsics,
    begins: Array,
    first: int,
    end: int,
    samples: Samples,
) -> None:
    """Fill in the samples of some rows of the drawing.

    The mean of both pictures' slopes takes half the iterations of the drawn one's alone. It holds
    only where samples were drawn: elsewhere the target has other slopes.

    Source:
        Benhimane and Malis, Real-time image-based tracking of planes using efficient second-order
        minimization, 2004.
    """
    half = np.float32(0.5)
    # Unpacked: access to an array in a tuple, pixel by pixel, takes half as long again.
    ids, barycentrics, depth = drawing.ids, drawing.barycentrics, drawing.depth
    Q, masks, triangles, set_of = support.Q, support.masks, support.triangles, support.set_of
    focal, cx, cy = intrinsics
    _, corners, inside, xs, ys, zs, luma, kept, slopes, mean, mixture, regions, target, _ = samples
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
            luma[n], kept[n] = drawn[row, col], weights[row, col]
            slopes[0, n], slopes[1, n] = _sobel(drawn, row, col)
            x, y = _sobel(target, row, col)
            mean[0, n], mean[1, n] = half * (x + slopes[0, n]), half * (y + slopes[1, n])
            for corner in range(3):
                corners[n, corner] = triangles[t, corner]
                inside[n, corner] = barycentrics[row, col, corner]
            # Eq. (7)'s sum over k of dw_k/dp I^_k, without the region's mask.
            for d in range(Q.shape[1]):
                change = np.float32(0)
                for k in range(Q.shape[0]):
                    change += Q[k, d] * layers[row, col, k]
                mixture[d, n] = change
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b = barycentrics[row, col]
            for r in range(masks.shape[1]):
                regions[r, n] = b[0] * masks[i, r] + b[1] * masks[j, r] + b[2] * masks[k, r]


class Warp(NamedTuple):
    """How other parameters move what was drawn.

    Attributes:
        R: (3, 3): R @ position + t, in camera space, is the rigid part.
        t: (3,) mm.
        intrinsics: of the other parameters.
        step: (N,) the unknowns less those that were drawn.
    """

    R: Float[Array, "3 3"]
    t: Float[Array, " 3"]
    intrinsics: Intrinsics
    step: Float[Array, " n"]


@njit(inline="always")
def sample_bicubic(picture: Array, width: int, height: int, x: float, y: float) -> np.float32:
    """A picture between its pixels, by Catmull-Rom splines; border pixels are repeated outside.

    Linear interpolation would blur, by an amount that depends on the position.

    Args:
        picture: (H * W,) float32, row after row.
        width: px.
        height: px.
        x: px, 0 at the first pixel's centre.
        y: px, 0 at the first pixel's centre.
    """
    x, y = min(max(x, 1.0), width - 2.001), min(max(y, 1.0), height - 2.001)
    col, row = int(x), int(y)
    a, b = _catmull_rom(np.float32(x - col)), _catmull_rom(np.float32(y - row))
    # Unsigned: Numba adds a branch for every index that may be negative.
    one, step = np.uint64(1), np.uint64(width)
    n0 = np.uint64((row - 1) * width + col - 1)
    n1, n2, n3 = n0 + step, n0 + step + step, n0 + step + step + step
    total: np.float32 = 0 * b[0]
    for weight in a:
        column = b[0] * picture[n0] + b[1] * picture[n1] + b[2] * picture[n2] + b[3] * picture[n3]
        total += weight * column
        n0, n1, n2, n3 = n0 + one, n1 + one, n2 + one, n3 + one
    return total


@njit(inline="always")
def _catmull_rom(u: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Weights of the four pixels around a point that is u after the second."""
    half, one, two = np.float32(0.5), np.float32(1), np.float32(2)
    three, four, five = np.float32(3), np.float32(4), np.float32(5)
    before = half * u * ((two - u) * u - one)
    here = half * (u * u * (three * u - five) + two)
    there = half * u * ((four - three * u) * u + one)
    return before, here, there, half * u * u * (u - one)
