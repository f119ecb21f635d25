"""Examples drawn where the standard image's points are ([Zhang 2006] section 5.2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.arrays import Array, Float, Int, UInt8
from mien.numeric.raster.rasterizer import Raster, rasterize
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["aligned_photos", "warp_to_raster"]


def aligned_photos(examples: ExampleSet) -> Iterator[UInt8[Array, "h w 4"]]:
    """Each example's photo warped to the standard image, to be looked at; transparent around it.

    The composer does not use these: it samples each photo once, where the result needs it.

    Args:
        examples: of the person.

    Yields:
        (h, w, 4) sRGB and alpha, of the standard photo's size.
    """
    layout = examples.layout
    standard = examples.examples[examples.standard]
    height, width = standard.photo.shape[:2]
    framed = np.concatenate([standard.points, layout.frame(standard.points)])
    raster = rasterize(framed, np.ones(len(framed)), layout.triangles, width, height)
    alpha = np.where(raster.mask, 255, 0).astype(np.uint8)
    for example in examples.examples:
        points = np.concatenate([example.points, layout.frame(example.points)])
        yield np.dstack([warp_to_raster(example.photo, points, layout.triangles, raster), alpha])


def warp_to_raster(
    photo: UInt8[Array, "h w 3"],
    points: Float[Array, "n 2"],
    triangles: Int[Array, "t 3"],
    raster: Raster,
) -> UInt8[Array, "y x 3"]:
    """A photo warped triangle by triangle to a raster of other points; black outside.

    Args:
        photo: (h, w, 3) sRGB.
        points: (n, 2) px of the photo.
        triangles: (t, 3) over the points.
        raster: of the same triangles over the points to warp to.
    """
    import cv2

    warped = np.zeros((*raster.mask.shape, 3), np.uint8)
    corners = points[triangles[raster.triangle_ids[raster.mask]]]
    positions = np.einsum("pk,pkd->pd", raster.barycentrics[raster.mask], corners)
    # The centre of OpenCV's first pixel is 0, ours 0.5.
    maps = np.full((*raster.mask.shape, 2), -1, np.float32)
    maps[raster.mask] = positions - 0.5
    sampled = cv2.remap(photo, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    warped[raster.mask] = sampled[raster.mask]
    return warped
