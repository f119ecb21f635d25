"""The subregions of the face on the mesh of a head ([Zhang 2006] section 9)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import GenericHead, load_generic_head
from mien.assets.subregions import default_subregions
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.skin_interpolation import behind_lips_and_lids, harmonic_extension

__all__ = ["HeadSubregions", "head_subregions"]

_PX_PER_MM = 2.0
_MARGIN_MM = 10.0
_MIN_FACING = 0.3
"""z of a unit normal; surfaces that are turned away more are too oblique to be drawn on."""
_MIN_COVERAGE = 0.5
"""Sum of the drawn weights up to which skin counts as drawn on; around the face they fade."""
_PARTS = {
    "left_eyeball": "left_eye",
    "right_eyeball": "right_eye",
    "upper_teeth": "teeth",
    "lower_teeth": "teeth",
    "tongue": "teeth",
}
"""The subregion of each of these parts of the mesh; they have no skin."""


@dataclass(frozen=True)
class HeadSubregions:
    """The subregions of every head with the generic one's mesh.

    Attributes:
        names: R of them, as in pictures.
        fades: (V, R) blend weights of each vertex, which sum to 1.
        members: of each, the indices of the feature points within it or on its boundary.
    """

    names: tuple[str, ...]
    fades: Float[Array, "v r"]
    members: tuple[Int[Array, " m"], ...]


@cache
def head_subregions() -> HeadSubregions:
    """The subregions that ship with mien, on the mesh of the generic head.

    They are drawn over its feature points in the front view. Eyeballs are subregions, teeth and
    tongue are one. To skin that the drawing does not reach, behind the lips and the lids, below the
    chin and around the face, the weights are extended smoothly: what lies below the jaw moves with
    it, and what expressions do not move stays.
    """
    generic, layout = load_generic_head(), load_feature_layout()
    points = feature_points_on(generic.mesh.vertices)
    front = points[:, :2] * [1, -1]
    framed = np.vstack([front, layout.frame(front)])
    low = framed.min(axis=0) - _MARGIN_MM
    width, height = np.ceil((np.ptp(framed, axis=0) + 2 * _MARGIN_MM) * _PX_PER_MM).astype(int)
    drawn = default_subregions(layout, (front - low) * _PX_PER_MM, (int(width), int(height)))
    positions = (generic.mesh.vertices[:, :2] * [1, -1] - low) * _PX_PER_MM
    without_skin = [name in _PARTS.values() for name in drawn.names]
    fades = _sampled(drawn.fades, positions)
    fades[:, without_skin] = 0
    total = fades.sum(axis=1, keepdims=True)
    drawn_on = _drawn_on(generic) & (total[:, 0] > _MIN_COVERAGE)
    fades = harmonic_extension(fades / np.maximum(total, _MIN_COVERAGE), drawn_on)
    for part, name in _PARTS.items():
        fades[generic.mesh.vertices_of(part)] = np.array(drawn.names) == name
    swapped = [drawn.names.index(_other_side(name)) for name in drawn.names]
    fades = (fades + fades[generic.mirror][:, swapped]) / 2
    fades /= fades.sum(axis=1, keepdims=True)
    return HeadSubregions(drawn.names, frozen(fades), drawn.members)


def _sampled(fades: Float[Array, "h w r"], positions: Float[Array, "v 2"]) -> Float[Array, "v r"]:
    """Bilinear interpolation; 0 outside of the picture."""
    from scipy.ndimage import map_coordinates

    rows, columns = positions[:, 1] - 0.5, positions[:, 0] - 0.5
    layers = np.moveaxis(fades, 2, 0)
    return np.stack([map_coordinates(layer, [rows, columns], order=1) for layer in layers], axis=1)


def _drawn_on(generic: GenericHead) -> Bool[Array, " v"]:
    """Skin that faces the front and is not hidden by lips or lids."""
    facing: Array = (generic.mesh.vertex_normals()[:, 2] > _MIN_FACING) & ~behind_lips_and_lids()
    skin = np.zeros(len(facing), bool)
    skin[generic.mesh.vertices_of("skin")] = True
    return facing & skin


def _other_side(name: str) -> str:
    """The subregion on the other side; its own name on the midline."""
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)
