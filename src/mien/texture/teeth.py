"""Default colours of teeth that no photo shows, tooth by tooth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mien.arrays import Array, Float

# Widths along the arch from the midline outwards (central incisor to second molar), as shares of
# the upper central incisor's: Wheeler's averages for permanent teeth.
_WIDTHS: Mapping[str, tuple[float, ...]] = {
    "upper_teeth": (1.0, 0.77, 0.88, 0.82, 0.82, 1.18, 1.06),
    "lower_teeth": (0.59, 0.65, 0.82, 0.82, 0.82, 1.29, 1.24),
}
_INCISOR_MM = 10.5
"""Of the generic head's arch, which is wider than people's."""
_CROWN_MM = 12.0
"""From the biting edge to the gum."""
_ENAMEL, _GUM = (226.0, 212.0, 190.0), (152.0, 86.0, 80.0)
_GAP_MM, _GAP_DEPTH = 0.7, 0.5
_FAR_MM, _FAR_LIGHT = 32.0, 0.25
"""At this distance behind the foremost teeth the light falls to this factor."""


def default_teeth_colours(points: Float[Array, "n 3"], part: str) -> Float[Array, "n 3"]:
    """(N, 3) sRGB of typical teeth and gums, from 0 to 255, in full light.

    Args:
        points: (N, 3) mm, on the teeth of the generic head.
        part: "upper_teeth" or "lower_teeth".
    """
    if not len(points):
        return np.zeros((0, 3), np.float32)
    x, y, z = np.asarray(points, np.float64).T
    edge = y.min() if part == "upper_teeth" else y.max()
    into_gum = np.abs(y - edge) - _CROWN_MM
    along = _arch_length(x, z)
    ends = _INCISOR_MM * np.cumsum(_WIDTHS[part])
    gaps = np.concatenate([[0.0], ends])
    to_gap = np.abs(np.abs(along)[:, None] - gaps).min(axis=1)
    # Gums reach down between the teeth.
    gum = np.clip((into_gum + 1.5 * np.exp(-((to_gap / 2.0) ** 2))) / 1.0 + 0.5, 0, 1)
    dark = _GAP_DEPTH * np.exp(-((to_gap / _GAP_MM) ** 2)) * (1 - gum)
    far = 1 - (1 - _FAR_LIGHT) * np.clip((z.max() - z) / _FAR_MM, 0, 1)
    colour = np.array(_ENAMEL) + gum[:, None] * (np.array(_GUM) - np.array(_ENAMEL))
    shaded: Array = colour * ((1 - dark) * far)[:, None]
    return shaded.astype(np.float32)


def _arch_length(x: Float[Array, " n"], z: Float[Array, " n"]) -> Float[Array, " n"]:
    """(N,) mm along the arch from the midline: that of the parabola through its front and ends."""
    front, half = float(z.max()), max(float(np.abs(x).max()), 1.0)
    drop = (front - float(z.min())) / half**2
    steps = np.linspace(0, half, 200)
    length = np.cumsum(np.hypot(1, 2 * drop * steps)) * (steps[1] - steps[0])
    return np.sign(x) * np.interp(np.abs(x), steps, length - length[0])
