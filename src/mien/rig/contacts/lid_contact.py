"""Kernels for contacts of two lids and an eyeball, in spherical coordinates.

Coordinates are longitude and latitude, radians, and radius on the unit sphere that the eyeball is
an affine image of (rig.contacts.lids); an edge has those of its vertices from corner to corner.
"""

from __future__ import annotations

import math

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.numeric.kernels.jit import njit

_ALLOWED = 1e-6
_ROUNDS = 4


@njit(cache=True, nogil=True)
def to_spherical(points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """(N, 3) spherical coordinates of points given as ahead, along and up from the centre."""
    coordinates = np.empty_like(points)
    for n in range(len(points)):
        ahead, along, up = points[n]
        flat = math.hypot(ahead, along)
        coordinates[n, 0] = math.atan2(along, ahead)
        coordinates[n, 1] = math.atan2(up, flat)
        coordinates[n, 2] = math.hypot(flat, up)
    return coordinates


@njit(cache=True, nogil=True)
def edge_overlap(upper: Float[Array, "u 3"], lower: Float[Array, "w 3"]) -> Float[Array, " u"]:
    """(U,) radians by which the upper edge's vertices lie below the lower edge."""
    return np.interp(upper[:, 0], _monotone(lower[:, 0]), lower[:, 1]) - upper[:, 1]


@njit(cache=True, nogil=True)
def radius_change(
    upper: Float[Array, "u 3"], lower: Float[Array, "w 3"], in_front: Float[Array, " u"]
) -> Float[Array, " u"]:
    """(U,) change of radius that puts the upper edge's vertices just in front of the lower edge."""
    return np.interp(upper[:, 0], _monotone(lower[:, 0]), lower[:, 2]) + in_front - upper[:, 2]


@njit(cache=True, nogil=True)
def interpolate_along_edge(
    longitudes: Float[Array, " n"], upper: int, corrections: Float[Array, " u"]
) -> Float[Array, " n"]:
    """(N,) corrections along the upper edge, whose vertices come first, interpolated elsewhere."""
    along = np.interp(longitudes, _monotone(longitudes[:upper]), corrections)
    # Close to a corner the edge doubles back, and its longitude is ambiguous.
    along[:upper] = corrections
    return along


@njit(cache=True, nogil=True)
def resolve_lid_contact(
    points: Float[Array, "l 3"],
    upper: int,
    lower: int,
    falloff: Float[Array, " l"],
    on_upper: Bool[Array, " l"],
    min_radius: Float[Array, " l"],
    full_overlap: Float[Array, " u"],
    in_front: Float[Array, " u"],
    stiffness: float,
    moves: Float[Array, "l 3"],
) -> bool:
    """Moves lids out of each other and out of the sphere; False if there is no contact.

    Args:
        points: on the lids, axes as in to_spherical; the edges first.
        upper: of rig.contacts.lids.Lids.
        lower: of rig.contacts.lids.Lids.
        falloff: of rig.contacts.lids.Lids.
        on_upper: of rig.contacts.lids.Lids.
        min_radius: of rig.contacts.lids.Lids.
        full_overlap: of rig.contacts.lids.Lids.
        in_front: of rig.contacts.lids.Lids.
        stiffness: contact per radian of excess overlap; from 1 on the lids lie on each other.
        moves: (L, 3) zeros, the result.
    """
    edges = to_spherical(points[: upper + lower])
    high, low = edges[:upper], edges[upper:]
    excess = _excess_overlap(edges, upper, falloff, on_upper, full_overlap)
    touching = excess.any()
    contact = np.minimum(excess * stiffness, 1.0)
    forward = radius_change(high, low, in_front) * contact
    if touching:
        # Corrections depend on longitude, which does not change.
        longitudes = np.arctan2(points[:, 1], points[:, 0])
        down = interpolate_along_edge(longitudes, upper, excess) / 2 * falloff
        out = interpolate_along_edge(longitudes, upper, forward) * falloff
    moved = False
    for n in range(len(points)):
        ahead, along, up = points[n]
        flat = math.sqrt(ahead * ahead + along * along)
        radius = math.sqrt(flat * flat + up * up)
        turn, rise = 0.0, 0.0
        if touching:
            turn = down[n] if on_upper[n] else -down[n]
            rise = out[n] if on_upper[n] else 0.0
        if radius + rise < min_radius[n] - _ALLOWED:
            rise = min_radius[n] - radius
        if turn == 0 and rise == 0:
            continue
        latitude = math.atan2(up, flat) + turn
        level = (radius + rise) * math.cos(latitude) / flat
        moves[n, 0], moves[n, 1] = ahead * (level - 1), along * (level - 1)
        moves[n, 2] = (radius + rise) * math.sin(latitude) - up
        moved = True
    return moved


@njit(cache=True, nogil=True)
def _excess_overlap(
    edges: Array, upper: int, falloff: Array, on_upper: Array, full_overlap: Array
) -> Array:
    """(U,) radians of excess overlap of the edges, which are moved out of each other."""
    excess = np.zeros(upper)
    for _ in range(_ROUNDS):
        too_far = edge_overlap(edges[:upper], edges[upper:]) - full_overlap
        if (too_far < _ALLOWED).all():
            break
        # Each lid moves by half.
        too_far = np.maximum(too_far, 0.0)
        excess += too_far
        back = interpolate_along_edge(edges[:, 0], upper, too_far) * falloff[: len(edges)] / 2
        edges[:, 1] += np.where(on_upper[: len(edges)], back, -back)
    return excess


@njit(cache=True, nogil=True)
def _monotone(values: Array) -> Array:
    """The running maximum, for interpolation; edges double back slightly at the corners."""
    monotone = values.copy()
    for n in range(1, len(monotone)):
        monotone[n] = max(monotone[n], monotone[n - 1])
    return monotone
