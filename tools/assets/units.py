"""The 52 face units, made exactly left-right symmetric."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from tools.assets.head import HeadCut
from tools.assets.makehuman import MakeHuman


def build_units(
    source: MakeHuman, head: HeadCut, polylines: dict[str, tuple[int, ...]]
) -> tuple[tuple[str, ...], Float[Array, "52 v 3"]]:
    """The units' names and offsets in mm.

    Each is averaged with its partner's mirror image (hm08's are symmetric but for rounding and a
    few vertices inside the lips). The blinks, which would drive the upper lid past the lower one,
    are weakened until the lids just meet.
    """
    names = source.unit_names
    offsets = np.stack([head.offsets_mm(source.unit(name)) for name in names])
    partners = [names.index(partner_name(name)) for name in names]
    mirrored = offsets[partners][:, head.mirror] * [-1, 1, 1]
    units: Array = (offsets + mirrored) / 2
    blinks = [names.index(f"eyeBlink{side}") for side in ("Left", "Right")]
    units[blinks] *= _blink_share(head.vertices, units[blinks[0]], polylines)
    return names, units


def _blink_share(
    vertices: Float[Array, "v 3"],
    blink: Float[Array, "v 3"],
    polylines: dict[str, tuple[int, ...]],
) -> float:
    """The weight of the left blink at which the middle of the upper lid meets the lower lid."""
    upper, lower = (list(polylines[f"left_{edge}_eyelid"]) for edge in ("upper", "lower"))
    middle = upper[2:-2]
    x = vertices[middle, 0]
    height, motion = (
        np.interp(x, vertices[lower, 0], values[lower, 1]) for values in (vertices, blink)
    )
    shares = (vertices[middle, 1] - height) / (motion - blink[middle, 1])
    return float(shares.mean())


def partner_name(name: str) -> str:
    """The name of the unit that does the same on the other side."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name
