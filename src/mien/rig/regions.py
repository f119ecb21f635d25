"""The regions of the face that are controlled independently ([Pighin 2002] sec. 6.1.1, fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.assets.generic import GenericHead
from mien.errors import InputError
from mien.rig.state import FACE

ENCLOSING_REGIONS: Mapping[str, tuple[str, ...]] = {
    FACE: (),
    "mouth": (FACE,),
    "eyes": (FACE,),
    "forehead": (FACE,),
    "left_mouth": ("mouth", FACE),
    "right_mouth": ("mouth", FACE),
    "left_eye": ("eyes", FACE),
    "right_eye": ("eyes", FACE),
    "left_forehead": ("forehead", FACE),
    "right_forehead": ("forehead", FACE),
}
"""All regions by name, each with the regions that contain it, nearest first."""

MASK_NAMES = (
    "left_mouth",
    "right_mouth",
    "left_eye",
    "right_eye",
    "left_forehead",
    "right_forehead",
)
"""Regions that have masks; the others are unions of them. The face has the rest of the head."""

_MIDLINE_MM = 12.0
"""Width of the blend from left to right."""
_RAMP = (0.3, 0.8)
"""Between upper lid (0) and brow (1): where the region of the eyes blends into the forehead's."""
_AT_LIDS = 0.8
"""Value of the generic mask of the eyes from which on the region of the eyes is 1."""
_PARTS = {
    "left_eyeball": "eyes",
    "right_eyeball": "eyes",
    "lashes": "eyes",
    "upper_teeth": "mouth",
    "lower_teeth": "mouth",
    "tongue": "mouth",
}


def default_masks(generic: GenericHead) -> dict[str, Float[Array, " v"]]:
    """(V,) in [0, 1] by name of MASK_NAMES: a partition of the face with soft borders.

    Surfaces behind lips, nostrils and lids belong to their regions, as do teeth and tongue, lashes
    and eyes. The border between eyes and forehead runs below the brows: across them, two
    expressions would show two brows.
    """
    regions, left = generic.regions, _left_weight(generic.mesh.vertices[:, 0])
    mouth = np.maximum(regions["mouth"], regions["mouth_cavity"])
    socket = regions["eye_socket"] * (1 - regions["mouth_cavity"])
    eyes = np.maximum(np.minimum(regions["eyes"] / _AT_LIDS, 1.0), socket)
    mouth = np.minimum(mouth, 1 - eyes)
    above = _above_lids(generic) * (1 - socket)
    forehead = regions["forehead"] + eyes * above
    eyes = eyes * (1 - above)
    whole = {"mouth": mouth, "eyes": eyes, "forehead": forehead}
    for part, region in _PARTS.items():
        inside = generic.mesh.vertices_of(part)
        for name, mask in whole.items():
            mask[inside] = name == region
    total = np.maximum(sum(whole.values()), 1.0)
    masks: dict[str, Float[Array, " v"]] = {}
    for name, mask in whole.items():
        half = "eye" if name == "eyes" else name
        masks[f"left_{half}"] = left * mask / total
        masks[f"right_{half}"] = (1 - left) * mask / total
    return {name: masks[name] for name in MASK_NAMES}


def _above_lids(generic: GenericHead) -> Float[Array, " v"]:
    """(V,) from 0 at the upper lids to 1 at the lower edge of the brows and above."""
    vertices = generic.mesh.vertices
    above = np.zeros(len(vertices))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        lid, brow = (
            vertices[list(generic.polylines[f"{side}_{line}"])]
            for line in ("upper_eyelid", "eyebrow_lower")
        )
        on_side = sign * vertices[:, 0] >= 0
        heights = [
            np.interp(sign * vertices[:, 0], *_rising(sign * line[:, 0], line[:, 1]))
            for line in (lid, brow)
        ]
        t = (vertices[:, 1] - heights[0]) / np.maximum(heights[1] - heights[0], 1.0)
        t = np.clip((t - _RAMP[0]) / (_RAMP[1] - _RAMP[0]), 0, 1)
        above[on_side] = (t * t * (3 - 2 * t))[on_side]
    return above


def _rising(x: Float[Array, " n"], y: Float[Array, " n"]) -> tuple[Array, Array]:
    order = np.argsort(x)
    return x[order], y[order]


def check_masks(masks: Mapping[str, object], vertices: int) -> dict[str, Float[Array, " v"]]:
    """(V,) masks by name, in the order of MASK_NAMES, scaled down where they sum to more than 1.

    A region without a mask gets an empty one: the weights of the face hold there.

    Raises:
        InputError: an unknown name, another shape, values outside [0, 1].
    """
    for name in masks:
        if name not in MASK_NAMES:
            raise InputError("regions", f"names of {', '.join(MASK_NAMES)}", name)
    checked = {}
    for name in MASK_NAMES:
        mask = check_array(f"region {name}", masks.get(name, np.zeros(vertices)), (vertices,))
        if mask.min(initial=0) < 0 or mask.max(initial=0) > 1:
            found = f"{mask.min():g} to {mask.max():g}"
            raise InputError(f"region {name}", "values from 0 to 1", found)
        checked[name] = mask
    total = np.maximum(np.sum(list(checked.values()), axis=0), 1.0)
    return {name: mask / total for name, mask in checked.items()}


def _left_weight(x: Float[Array, " v"]) -> Float[Array, " v"]:
    """(V,) smoothly from 0 on the subject's right to 1 on the left."""
    t = np.clip(x / _MIDLINE_MM + 0.5, 0, 1)
    return t * t * (3 - 2 * t)
