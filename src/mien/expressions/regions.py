"""The regions of the face that are controlled independently (P02 sec. 6.1.1, fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.assets.generic import GenericHead
from mien.errors import InputError
from mien.expressions.state import FACE

AROUND: Mapping[str, tuple[str, ...]] = {
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
"""All regions by name, and those around each from the nearest on."""

MASKS = ("left_mouth", "right_mouth", "left_eye", "right_eye", "left_forehead", "right_forehead")
"""The regions that have masks; the others are made of them. The rest of the head is the face's."""

_MIDLINE_MM = 12.0
"""Width over which left gives way to right."""
_PARTS = {
    "left_eyeball": "left_eye",
    "right_eyeball": "right_eye",
    "upper_teeth": "mouth",
    "lower_teeth": "mouth",
    "tongue": "mouth",
}


def default_masks(generic: GenericHead) -> dict[str, Float[Array, " v"]]:
    """(V,) in [0, 1] by name of MASKS: a partition of the face with soft borders.

    Eyes, teeth and tongue go with the region around them.
    """
    left = _left_share(generic.mesh.vertices[:, 0])
    whole = {name: generic.regions[name].astype(np.float64) for name in ("mouth", "forehead")}
    masks = {f"left_{name}": left * mask for name, mask in whole.items()}
    masks |= {f"right_{name}": (1 - left) * mask for name, mask in whole.items()}
    masks |= {name: generic.regions[name].astype(np.float64) for name in ("left_eye", "right_eye")}
    for part, region in _PARTS.items():
        inside = np.unique(generic.mesh.triangles[generic.mesh.triangles_of(part)])
        for name, mask in masks.items():
            share = left if name.startswith("left_") else 1 - left
            belongs = name == region or region in AROUND[name]
            mask[inside] = (share[inside] if region == "mouth" else 1.0) if belongs else 0.0
    return {name: masks[name] for name in MASKS}


def check_masks(masks: Mapping[str, object], vertices: int) -> dict[str, Float[Array, " v"]]:
    """(V,) masks by name, in the order of MASKS, scaled down where they sum to more than 1.

    A region that is left out has an empty mask: the face's weights hold there.
    Raises: InputError: an unknown name, another shape, values outside [0, 1].
    """
    for name in masks:
        if name not in MASKS:
            raise InputError("regions", f"names of {', '.join(MASKS)}", name)
    checked = {}
    for name in MASKS:
        mask = check_array(f"region {name}", masks.get(name, np.zeros(vertices)), (vertices,))
        if mask.min(initial=0) < 0 or mask.max(initial=0) > 1:
            found = f"{mask.min():g} to {mask.max():g}"
            raise InputError(f"region {name}", "values from 0 to 1", found)
        checked[name] = mask
    total = np.maximum(np.sum(list(checked.values()), axis=0), 1.0)
    return {name: mask / total for name, mask in checked.items()}


def _left_share(x: Float[Array, " v"]) -> Float[Array, " v"]:
    """(V,) smoothly from 0 on the subject's right to 1 on the left."""
    t = np.clip(x / _MIDLINE_MM + 0.5, 0, 1)
    share: Array = t * t * (3 - 2 * t)
    return share
