"""The subregions of the face on the mesh of a head ([Zhang 2006] section 9)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import GenericHead, load_generic_head
from mien.assets.subregions import default_subregions
from mien.rig.followers import part_vertices
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.skin_interpolation import behind_lips_and_lids, harmonic_extension

__all__ = ["HeadSubregions", "head_subregions"]

_PX_PER_MM = 2.0
_MARGIN_MM = 10.0
_FACING = 0.3
"""Of the normal towards the front: what turns away more is seen too flat to be drawn on."""
_OUTLINE = 0.5
"""Of what a drawing holds of the face, as far as which it is drawn: there it fades in pictures."""
_PARTS = {
    "left_eyeball": "left_eye",
    "right_eyeball": "right_eye",
    "upper_teeth": "teeth",
    "lower_teeth": "teeth",
    "tongue": "teeth",
}
"""Parts of the mesh that are subregions by themselves; those hold nothing of the skin."""


@dataclass(frozen=True)
class HeadSubregions:
    """The subregions of every head with the generic one's mesh.

    Attributes:
        names: R of them, as in pictures.
        fades: (V, R) each vertex's shares, which sum to 1.
        members: of each, the indices of the feature points within it or on its boundary.
    """

    names: tuple[str, ...]
    fades: Float[Array, "v r"]
    members: tuple[Int[Array, " m"], ...]


@cache
def head_subregions() -> HeadSubregions:
    """The subregions that ship with mien, on the mesh of the generic head.

    They are drawn over its feature points as the front shows them. Eyeballs, teeth and tongue are
    those of their own. Skin that the drawing does not reach, behind the lips and the lids, below
    the chin and around the face, goes on smoothly from where it does: a jaw takes what hangs on it
    along, and what expressions leave still stays so.
    """
    generic, layout = load_generic_head(), load_feature_layout()
    points = feature_points_on(generic.mesh.vertices)
    front = points[:, :2] * [1, -1]
    around = np.vstack([front, layout.frame(front)])
    low = around.min(axis=0) - _MARGIN_MM
    width, height = np.ceil((np.ptp(around, axis=0) + 2 * _MARGIN_MM) * _PX_PER_MM).astype(int)
    drawn = default_subregions(layout, (front - low) * _PX_PER_MM, (int(width), int(height)))
    places = (generic.mesh.vertices[:, :2] * [1, -1] - low) * _PX_PER_MM
    own = [name in _PARTS.values() for name in drawn.names]
    fades = _sampled(drawn.fades, places)
    fades[:, own] = 0
    total = fades.sum(axis=1, keepdims=True)
    drawn_on = _drawn_on(generic) & (total[:, 0] > _OUTLINE)
    fades = harmonic_extension(fades / np.maximum(total, _OUTLINE), drawn_on)
    for part, name in _PARTS.items():
        fades[part_vertices(generic, part)] = np.array(drawn.names) == name
    swapped = [drawn.names.index(_other_side(name)) for name in drawn.names]
    fades = (fades + fades[generic.mirror][:, swapped]) / 2
    fades /= fades.sum(axis=1, keepdims=True)
    return HeadSubregions(drawn.names, frozen(fades), drawn.members)


def _sampled(fades: Float[Array, "h w r"], places: Float[Array, "v 2"]) -> Float[Array, "v r"]:
    """Between the pixels, linearly; outside of the picture there are none."""
    from scipy.ndimage import map_coordinates

    rows, columns = places[:, 1] - 0.5, places[:, 0] - 0.5
    layers = np.moveaxis(fades, 2, 0)
    return np.stack([map_coordinates(layer, [rows, columns], order=1) for layer in layers], axis=1)


def _drawn_on(generic: GenericHead) -> Bool[Array, " v"]:
    """Skin that faces the front and lies behind nothing."""
    facing: Array = (generic.mesh.vertex_normals()[:, 2] > _FACING) & ~behind_lips_and_lids()
    skin = np.zeros(len(facing), bool)
    skin[part_vertices(generic, "skin")] = True
    return facing & skin


def _other_side(name: str) -> str:
    """The subregion on the other side; its own name on the midline."""
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)
