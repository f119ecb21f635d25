"""Examples drawn where the standard image's points are ([Zhang 2006] section 5.2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.arrays import Array, Float, Int, UInt8
from mien.numeric.raster.rasterizer import Raster, rasterize
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["aligned_photos", "warp_to_raster"]


def aligned_photos(examples: ExampleSet) -> Iterator[UInt8[Array, "h w 4"]]:
    """Each example's photo over the standard image, for people to look at; transparent around.

    Mien itself does not use these: it looks every photo up once, where the result needs it.

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
    """A photo drawn where the raster of the same triangles over other points lies; else black.

    Args:
        points: (n, 2) px of the photo.
    """
    import cv2

    drawn = np.zeros((*raster.mask.shape, 3), np.uint8)
    corners = points[triangles[raster.triangle_ids[raster.mask]]]
    places = np.einsum("pk,pkd->pd", raster.barycentrics[raster.mask], corners)
    # OpenCV counts from the first pixel's centre.
    maps = np.full((*raster.mask.shape, 2), -1, np.float32)
    maps[raster.mask] = places - 0.5
    found = cv2.remap(photo, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    drawn[raster.mask] = found[raster.mask]
    return drawn
