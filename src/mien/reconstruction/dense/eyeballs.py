"""Eyeballs in their sockets: behind the lids, which lie on them."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.assets.generic import GenericHead

_LID_MM = 3.0
"""Skin this near to the generic head's eyeball lies on it."""
_OPENING_MM = 1.0
"""Skin that touches it so closely is the lid's edge or inside."""
_CENTRE_SD_MM = 6.0
"""How far the eyeball moves from where the skin around it has carried it."""
_RADIUS_SD_MM = 2.0
"""How far an eyeball's radius is off the generic head's: eyes differ by less, but so do scales."""
_ROUNDS = 10
_EYEBALLS = ("left_eyeball", "right_eyeball")


def fit_eyeballs(vertices: Float[Array, "v 3"], generic: GenericHead) -> Float[Array, "v 3"]:
    """The head with round eyeballs that fill the room between the lids.

    Lids are tracked badly (lashes, moisture, shadows), so that a ball which goes with the skin
    around it can come out through a lid, or leave a gap beside it. Each ball takes the place and
    the size at which the lids lie as far off it as they do on the generic head; a lid that is still
    inside is lifted out.
    """
    result = vertices.copy()
    for name in _EYEBALLS:
        ball = generic.mesh.vertices_of(name)
        lids, gap = _lids(ball, generic)
        shape = generic.mesh.vertices[ball] - generic.mesh.vertices[ball].mean(axis=0)
        prior_mean = float(np.linalg.norm(shape, axis=1).max())
        # Lids that are a little inside the generic ball say nothing of its point.
        outside = gap > 0
        start = vertices[ball].mean(axis=0)
        centre, radius = _fit_sphere(vertices[lids[outside]], gap[outside], start, prior_mean)
        result[ball] = centre + radius / prior_mean * shape
        result[lids] = _outside_sphere(vertices[lids], gap, centre, radius)
    return result


def _lids(
    ball: Int[Array, " b"], generic: GenericHead
) -> tuple[Int[Array, " l"], Float[Array, " l"]]:
    """Skin vertices on the generic head's eyeball, and how far off it they lie, mm."""
    vertices = generic.mesh.vertices
    centre = vertices[ball].mean(axis=0)
    radius = float(np.linalg.norm(vertices[ball] - centre, axis=1).max())
    skin: Bool[Array, " v"] = np.zeros(len(vertices), bool)
    skin[generic.mesh.triangles[generic.mesh.triangles_of("skin")]] = True
    gap = np.linalg.norm(vertices - centre, axis=1) - radius
    lids = np.flatnonzero(skin & (gap < _LID_MM) & (vertices[:, 2] > centre[2]))
    near: Array = np.maximum(gap[lids], 0.0)
    return lids, near


def _fit_sphere(
    lids: Float[Array, "l 3"], gap: Float[Array, " l"], centre: Float[Array, " 3"], radius: float
) -> tuple[Float[Array, " 3"], float]:
    """Centre and radius at which the lids lie radius + gap off, near what is given (Gauss-Newton).

    Args:
        lids: (L, 3) mm.
        gap: (L,) mm, distances of the lids from the ball.
        centre: where the skin around the ball has carried it.
        radius: mm, a prior_mean one.
    """
    prior_mean = np.append(centre, radius)
    prior = len(lids) / np.append(np.full(3, _CENTRE_SD_MM), _RADIUS_SD_MM) ** 2
    sphere = prior_mean
    for _ in range(_ROUNDS):
        away = lids - sphere[:3]
        length = np.linalg.norm(away, axis=1)
        off = length - sphere[3] - gap
        # One lid out of point must not push the ball.
        weights = 1 / (1 + off**2)
        jacobian = np.column_stack([-away / length[:, None], -np.ones(len(lids))])
        weighted = weights[:, None] * jacobian
        gradient = weighted.T @ off + prior * (sphere - prior_mean)
        sphere = sphere - np.linalg.solve(weighted.T @ jacobian + np.diag(prior), gradient)
    return sphere[:3], float(sphere[3])


def _outside_sphere(
    lids: Float[Array, "l 3"], gap: Float[Array, " l"], sphere: Float[Array, " 3"], radius: float
) -> Float[Array, "l 3"]:
    """Lids at least as far out as half their gap."""
    away = lids - sphere
    length = np.linalg.norm(away, axis=1)
    least = radius + np.minimum(gap / 2, _OPENING_MM)
    return sphere + away * (np.maximum(length, least) / length)[:, None]
