"""The 52 face units, made exactly left-right symmetric."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from tools.assets.head import HeadCut
from tools.assets.makehuman import MakeHuman


def symmetric_units(
    source: MakeHuman, head: HeadCut
) -> tuple[tuple[str, ...], Float[Array, "52 v 3"]]:
    """The units' names and offsets in mm, each averaged with its partner's mirror image.

    hm08's units are symmetric but for rounding and a few vertices of the lips' inside.
    """
    names = source.unit_names
    offsets = np.stack([head.offsets_mm(source.unit(name)) for name in names])
    partners = [names.index(partner_name(name)) for name in names]
    mirrored = offsets[partners][:, head.mirror] * [-1, 1, 1]
    symmetric: Array = (offsets + mirrored) / 2
    return names, symmetric


def partner_name(name: str) -> str:
    """The name of the unit that does the same on the other side."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name
