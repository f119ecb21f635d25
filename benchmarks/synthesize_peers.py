"""The nearest that other libraries offer to synthesis, to be timed beside mien."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import cv2
import numpy as np

from mien.arrays import Array
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["mixed_by_numpy", "opencv_warp", "skimage_warp"]


def opencv_warp(examples: ExampleSet, points: Array) -> Array:
    """The usual loop: each triangle's box warped, and copied where the triangle is."""
    layout, photo = examples.layout, examples.neutral.photo
    height, width = photo.shape[:2]
    frame = layout.frame(examples.neutral.points)
    source = np.concatenate([examples.neutral.points, frame])
    target = np.concatenate([points, frame])
    out: Array = photo.copy()
    for triangle in layout.triangles:
        source_corners, target_corners = np.float32(source[triangle]), np.float32(target[triangle])
        low = np.maximum(np.floor(target_corners.min(0)).astype(int), 0)
        high = np.minimum(np.ceil(target_corners.max(0)).astype(int), [width, height])
        if (high <= low).any():
            continue
        size = (int(high[0] - low[0]), int(high[1] - low[1]))
        affine = cv2.getAffineTransform(source_corners, np.float32(target_corners - low))
        warped = cv2.warpAffine(photo, affine, size, borderMode=cv2.BORDER_REPLICATE)
        mask = np.zeros(size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, np.int32(np.round(target_corners - low)), 1)
        box = out[low[1] : high[1], low[0] : high[0]]
        box[mask > 0] = warped[mask > 0]
    return out


def mixed_by_numpy(examples: ExampleSet, coefficients: Array) -> Callable[[int], object]:
    """Eq. (6) and (7) over aligned images, without any warp."""
    images = np.stack([example.photo for example in examples.examples]).astype(np.float32)
    fades, weights = examples.subregions.fades, coefficients.astype(np.float32)
    return lambda _: np.einsum("hwm,mhwc->hwc", fades @ weights, images).astype(np.uint8)


def skimage_warp(examples: ExampleSet, points: Array) -> Callable[[int], object]:
    """PiecewiseAffineTransform, estimated and applied.

    Raises:
        ImportError: it is not installed.
    """
    transform = importlib.import_module("skimage.transform")
    source, photo = examples.neutral.points, examples.neutral.photo

    def warp(_: int) -> object:
        motion = transform.PiecewiseAffineTransform.from_estimate(points, source)
        return transform.warp(photo, motion)

    return warp
