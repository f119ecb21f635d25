"""How sharp a face is in a picture."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.capture.images.photos import downscale

_SIDE = 192
_BLOCK = 8


def face_sharpness(pixels: UInt8[Array, "h w 3"], points: Float[Array, "n 2"]) -> float:
    """Variance of the Laplacian over the face, at a common size and normalized by contrast.

    Block artefacts of the coder lower it.

    Args:
        pixels: (H, W, 3) sRGB.
        points: (N, 2) px of the face's landmarks; what lies outside of the picture is left out.
    """
    import cv2

    low = np.maximum(points.min(axis=0), 0).astype(int)
    high = np.maximum(np.ceil(points.max(axis=0)), 0).astype(int)
    crop = pixels[low[1] : high[1], low[0] : high[0]]
    if crop.size == 0:
        return 0.0
    small = np.ascontiguousarray(downscale(crop, _SIDE))
    grey = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float64)
    sharpness = float(cv2.Laplacian(grey, cv2.CV_64F).var() / (grey.var() + 1.0))
    return sharpness / _blockiness(pixels) ** 2


def _blockiness(pixels: UInt8[Array, "h w 3"]) -> float:
    """How much larger steps are at the borders of 8x8 blocks than inside: 1 without artefacts.

    The first frames of a clip are often coded so coarsely that their blocks dominate.
    """
    grey = pixels[..., 1].astype(np.float32)
    ratios = []
    for image in (grey, grey.T):
        steps = np.abs(np.diff(image, axis=1)).mean(axis=0)
        border = np.arange(len(steps)) % _BLOCK == _BLOCK - 1
        if border.any():
            ratios.append(float(steps[border].mean() / max(float(steps[~border].mean()), 1e-3)))
    return max(1.0, float(np.mean(ratios or [1.0])))
