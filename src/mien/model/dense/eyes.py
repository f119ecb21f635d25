"""Eyeballs in their sockets: behind the lids, which lie on them."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.assets.generic import GenericHead

_LID_MM = 3.0
"""Skin this near to the generic head's eyeball lies on it."""
_OPENING_MM = 1.0
"""Skin that touches it so closely is the lid's edge or inside."""
_TRUST_MM = 6.0
"""How far the eyeball moves from where the skin around it has carried it."""
_ROUNDS = 10
_EYEBALLS = ("left_eyeball", "right_eyeball")


def seat_eyes(vertices: Float[Array, "v 3"], generic: GenericHead) -> Float[Array, "v 3"]:
    """The head with its eyeballs where the lids leave room for them.

    Lids are tracked badly (lashes, moisture, shadows), so that a ball which goes with the skin
    around it can come out through a lid. Each ball is moved to where the lids lie as far off it as
    they do on the generic head; a lid that is still inside is lifted out.
    """
    result = vertices.copy()
    for name in _EYEBALLS:
        ball = np.unique(generic.mesh.triangles[generic.mesh.triangles_of(name)])
        lids, gap = _lids(ball, generic)
        centre = vertices[ball].mean(axis=0)
        radius = float(np.linalg.norm(vertices[ball] - centre, axis=1).max())
        seat = _seat(vertices[lids], gap, centre, radius)
        result[ball] = vertices[ball] + seat - centre
        result[lids] = _lifted(vertices[lids], gap, seat, radius)
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


def _seat(
    lids: Float[Array, "l 3"], gap: Float[Array, " l"], centre: Float[Array, " 3"], radius: float
) -> Float[Array, " 3"]:
    """The centre from which the lids lie radius + gap away, near where it was (Gauss-Newton)."""
    seat = centre
    for _ in range(_ROUNDS):
        away = lids - seat
        length = np.linalg.norm(away, axis=1)
        off = length - radius - gap
        # One lid out of place must not push the ball.
        weights = 1 / (1 + off**2)
        normal = (weights[:, None] * away).T @ (away / length[:, None] ** 2)
        gradient = (weights * off / length) @ away - (seat - centre) * len(lids) / _TRUST_MM**2
        seat = seat + np.linalg.solve(normal + np.eye(3) * len(lids) / _TRUST_MM**2, gradient)
    return seat


def _lifted(
    lids: Float[Array, "l 3"], gap: Float[Array, " l"], seat: Float[Array, " 3"], radius: float
) -> Float[Array, "l 3"]:
    """Lids at least as far out as half their gap."""
    away = lids - seat
    length = np.linalg.norm(away, axis=1)
    least = radius + np.minimum(gap / 2, _OPENING_MM)
    lifted: Array = seat + away * (np.maximum(length, least) / length)[:, None]
    return lifted
