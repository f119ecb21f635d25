"""Filling the holes of an image from their surroundings.

Two ways, both [Pighin 2002] sec. 5.2.2: an image pyramid (Gortler et al. 1996) and growth by one
pixel at a time. Both leave known pixels as they are and reproduce a constant. With `wrap`, the left
and right ends of the image touch, as on a cylinder.
"""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.errors import InputError
from mien.numeric.kernels.jit import njit


def fill_pyramid(
    image: Float[Array, "h w c"], weights: Float[Array, "h w"], *, wrap: bool = False
) -> Float[Array, "h w c"]:
    """Holes filled smoothly, by averages over ever larger surroundings: (H, W, C) float32.

    Args:
        image: (H, W, C); pixels of weight zero have no influence.
        weights: (H, W) in [0, 1]: confidence of each pixel. In between, the result is a blend.
        wrap: left and right ends touch.

    Raises:
        InputError: shapes, weights all zero.

    Source:
        [Pighin 2002] sec. 5.2.2, after Gortler et al., The Lumigraph, 1996 (pull and push).
    """
    image, weights = _check(image, weights)
    weighted = np.concatenate([image * weights[..., None], weights[..., None]], axis=2)
    levels = [weighted]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_pull(levels[-1]))
    filled = levels[-1][..., :-1] / levels[-1][..., -1:]
    for level in reversed(levels[:-1]):
        colour, weight = level[..., :-1], level[..., -1:]
        # `colour` is multiplied by its weight already.
        filled = colour + (1 - weight) * _push(filled, level.shape[0], level.shape[1], wrap)
    return np.where(weights[..., None] >= 1, image, filled).astype(np.float32)


def fill_growing(
    image: Float[Array, "h w c"], known: Bool[Array, "h w"], *, wrap: bool = False
) -> Float[Array, "h w c"]:
    """Holes filled by growing the known area a pixel at a time: (H, W, C) float32.

    Each new pixel is the mean of its known neighbours, of eight.

    Args:
        image: (H, W, C).
        known: (H, W) bool.
        wrap: left and right ends touch.

    Raises:
        InputError: shapes, nothing known.

    Source:
        [Pighin 2002] sec. 5.2.2, first algorithm.
    """
    image, weights = _check(image, np.asarray(known, bool))
    out = np.ascontiguousarray(image)
    _grow(out, weights.astype(np.int32), wrap)
    return out


def _check(image: Array, weights: Array) -> tuple[Array, Array]:
    image = check_array("image", image, (None, None, None), dtype=np.float32).copy()
    weights = check_array("weights", weights, image.shape[:2], dtype=np.float32)
    if not weights.max(initial=0) > 0:
        raise InputError("weights", "at least one known pixel", "none")
    if weights.min() < 0 or weights.max() > 1:
        raise InputError("weights", "from 0 to 1", f"{weights.min()} to {weights.max()}")
    return image, weights


def _pull(level: Array) -> Array:
    """Half the size: sums over 2 x 2, weights saturated at 1 (a full average is fully known)."""
    height, width = level.shape[:2]
    padded = np.pad(level, ((0, height % 2), (0, width % 2), (0, 0)))
    rows = padded[0::2] + padded[1::2]
    sums: Array = rows[:, 0::2] + rows[:, 1::2]
    return sums / np.maximum(sums[..., -1:], 1)


def _push(coarse: Array, height: int, width: int, wrap: bool) -> Array:
    """Twice the size, bilinear between the centres of coarse pixels."""
    fine: Array = _double(_double(coarse, 1, wrap), 0, False)
    return fine[:height, :width]


def _double(array: Array, axis: int, wrap: bool) -> Array:
    ahead, behind = np.roll(array, -1, axis), np.roll(array, 1, axis)
    if not wrap:
        ends: list[slice] = [slice(None)] * array.ndim
        ends[axis] = slice(-1, None)
        ahead[tuple(ends)] = array[tuple(ends)]
        ends[axis] = slice(0, 1)
        behind[tuple(ends)] = array[tuple(ends)]
    pair = np.stack([0.75 * array + 0.25 * behind, 0.75 * array + 0.25 * ahead], axis + 1)
    shape = list(array.shape)
    shape[axis] *= 2
    return pair.reshape(shape)


@njit(cache=True)
def _grow(image: Array, state: Array, wrap: bool) -> None:
    """Fill where state is 0. State counts rounds: pixels of this round see only earlier ones."""
    height, width = state.shape
    front = np.empty((height * width, 2), np.int32)
    size = 0
    for row in range(height):
        for col in range(width):
            if state[row, col] == 1:
                front[size, 0], front[size, 1] = row, col
                size += 1
    begin, end, round_ = 0, size, 1
    while begin < end:
        # The next front: unknown neighbours of this one, each once.
        for n in range(begin, end):
            for step in range(9):
                row, col = front[n, 0] + step // 3 - 1, front[n, 1] + step % 3 - 1
                if wrap:
                    col %= width
                if 0 <= row < height and 0 <= col < width and state[row, col] == 0:
                    state[row, col] = round_ + 1
                    front[size, 0], front[size, 1] = row, col
                    size += 1
        begin, end, round_ = end, size, round_ + 1
        for n in range(begin, end):
            _average_known(image, state, front[n, 0], front[n, 1], round_, wrap)


@njit(cache=True)
def _average_known(image: Array, state: Array, row: int, col: int, round_: int, wrap: bool) -> None:
    height, width, channels = image.shape
    image[row, col] = 0
    count = 0
    for step in range(9):
        r, c = row + step // 3 - 1, col + step % 3 - 1
        if wrap:
            c %= width
        if 0 <= r < height and 0 <= c < width and 0 < state[r, c] < round_:
            count += 1
            for channel in range(channels):
                image[row, col, channel] += image[r, c, channel]
    for channel in range(channels):
        image[row, col, channel] /= count
