"""Textures in shades of grey, interleaved so that one memory access serves all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Int, UInt16, frozen
from mien.numeric.kernels.jit import njit
from mien.render.mipmap import UNIT, Four, Pyramids

LUMA = (0.299, 0.587, 0.114)
"""Of red, green and blue (BT.601). Faces are compared in shades of grey: as accurate as in colour,
at a third of the cost (docs/notes/tracking-experiments.md)."""
STEPS = 256
_FINEST = 1024
"""Px of a texture's side: faces are compared at sizes that need no finer level."""


class GreyPyramids(NamedTuple):
    """Mipmaps of several textures, in grey (see render.mipmap.Pyramids for colour).

    Attributes:
        texels: (N, K) uint16 luma of K textures, in steps of 1 / STEPS of a grey level; level after
            level, row after row.
        widths: (L,) of the levels.
        heights: (L,) of the levels.
        starts: (L,) the first texel of each level.
        dropped: how many finer levels were left out.
    """

    texels: UInt16[Array, "n k"]
    widths: Int[Array, " l"]
    heights: Int[Array, " l"]
    starts: Int[Array, " l"]
    dropped: int


def grey_pyramids(pyramids: Pyramids) -> GreyPyramids:
    """The same textures in grey, without the levels that are too fine to be used."""
    dropped = int(np.argmax(np.minimum(pyramids.widths, pyramids.heights) <= _FINEST))
    first = int(pyramids.starts[dropped])
    packed = pyramids.texels[:, first:].T
    texels = np.zeros(packed.shape, np.float32)
    for shift, coefficient in zip((0, 8, 16), LUMA, strict=True):
        texels += np.float32(coefficient) * ((packed >> np.uint32(shift)) & np.uint32(255))
    sizes = (pyramids.widths, pyramids.heights, pyramids.starts - first)
    widths, heights, starts = (frozen(array[dropped:].copy()) for array in sizes)
    greys = frozen(np.rint(STEPS * texels).astype(np.uint16))
    return GreyPyramids(greys, widths, heights, starts, dropped)


@njit(inline="always")
def add_greys(texels: Array, fine: Four, coarse: Four, greys: Array) -> None:
    """Fill in (K,) the luma of every texture, interpolated (render.mipmap.place_lookup)."""
    scale = np.float32(1 / (UNIT * STEPS))
    for n in range(len(greys)):
        greys[n] = 0.0
    for corner in range(4):
        near, far = scale * np.float32(fine[4 + corner]), scale * np.float32(coarse[4 + corner])
        for n in range(len(greys)):
            greys[n] += near * np.float32(texels[fine[corner], n])
            greys[n] += far * np.float32(texels[coarse[corner], n])
