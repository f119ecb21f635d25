"""Bilinear sampling of images. Pixel (column, row) has its centre at (+0.5, +0.5)."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.errors import InputError
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands


def sample_bilinear(image: Array, xy: Float[Array, "n 2"]) -> Float[Array, "n c"]:
    """Colours at positions in an image, (N, C) float32 in the image's own units.

    OpenCV's remap is about as fast but rounds positions to 1/32 px, which shows in derivatives.

    Args:
        image: (H, W, C) uint8 or float32.
        xy: (N, 2) px; beyond the outermost centres the image goes on as it ends.

    Raises:
        InputError: shapes, an empty image, NaN.
    """
    if image.ndim != 3 or image.size == 0:
        raise InputError("image", "an (h, w, c) image", f"shape {image.shape}")
    xy = check_array("xy", xy, (None, 2))
    pixels = frozen(
        np.ascontiguousarray(image, np.uint8 if image.dtype == np.uint8 else np.float32)
    )
    positions = frozen(np.ascontiguousarray(xy))
    out = np.empty((len(xy), image.shape[2]), np.float32)
    for_row_bands(lambda a, b: _sample_rows(pixels, positions, a, b, out), len(xy), work=len(xy))
    return out


@njit(cache=True, nogil=True)
def bilinear_neighbours(
    x: float, y: float, width: int, height: int
) -> tuple[int, int, int, int, float, float]:
    """The four pixels around a position and the fractions between them: x0, x1, y0, y1, fx, fy."""
    x = min(max(x - 0.5, 0.0), width - 1.0)
    y = min(max(y - 0.5, 0.0), height - 1.0)
    x0, y0 = int(x), int(y)
    return x0, min(x0 + 1, width - 1), y0, min(y0 + 1, height - 1), x - x0, y - y0


@njit(cache=True, nogil=True)
def _sample_rows(image: Array, xy: Array, first: int, end: int, out: Array) -> None:
    height, width, channels = image.shape
    for n in range(first, end):
        x0, x1, y0, y1, fx, fy = bilinear_neighbours(xy[n, 0], xy[n, 1], width, height)
        for c in range(channels):
            above = (1.0 - fx) * image[y0, x0, c] + fx * image[y0, x1, c]
            below = (1.0 - fx) * image[y1, x0, c] + fx * image[y1, x1, c]
            out[n, c] = (1.0 - fy) * above + fy * below
