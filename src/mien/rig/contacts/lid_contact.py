"""Two lids and an eyeball in numbers: where the lids are on it, and how they get off each other.

A place is longitude and latitude, radians, and radius on the unit sphere that the eyeball is an
image of (rig.contacts.lids); an edge is the coordinates of its vertices from one corner to the other.
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
    """(N, 3) coordinates of points, told ahead, along and up from the middle of the sphere."""
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
    return np.interp(upper[:, 0], _rising(lower[:, 0]), lower[:, 1]) - upper[:, 1]


@njit(cache=True, nogil=True)
def radius_change(
    upper: Float[Array, "u 3"], lower: Float[Array, "w 3"], in_front: Float[Array, " u"]
) -> Float[Array, " u"]:
    """(U,) change of radius that lays the upper edge's vertices just before the lower edge."""
    return np.interp(upper[:, 0], _rising(lower[:, 0]), lower[:, 2]) + in_front - upper[:, 2]


@njit(cache=True, nogil=True)
def interpolate_along_edge(
    longitudes: Float[Array, " n"], upper: int, corrections: Float[Array, " u"]
) -> Float[Array, " n"]:
    """(N,) what corrections along the upper edge, whose vertices are the first, are elsewhere."""
    along = np.interp(longitudes, _rising(longitudes[:upper]), corrections)
    # Close to a corner the edge doubles back, and its longitude tells no place on it.
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
    """How points of the lids move out of each other and out of the sphere, if any does.

    Args:
        points: on the lids, told as in to_spherical; the edges first.
        upper: of rig.contacts.lids.Lids.
        lower: of rig.contacts.lids.Lids.
        falloff: of rig.contacts.lids.Lids.
        on_upper: of rig.contacts.lids.Lids.
        min_radius: of rig.contacts.lids.Lids.
        full_overlap: of rig.contacts.lids.Lids.
        in_front: of rig.contacts.lids.Lids.
        stiffness: how firmly lids lie on each other that overlap by a radian too much.
        moves: (L, 3) zeros, where to write.
    """
    edges = to_spherical(points[: upper + lower])
    high, low = edges[:upper], edges[upper:]
    pressed = _excess_overlap(edges, upper, falloff, on_upper, full_overlap)
    touching = pressed.any()
    firmly = np.minimum(pressed * stiffness, 1.0)
    forth = radius_change(high, low, in_front) * firmly
    if touching:
        # What a vertex gives way by follows from its longitude, which does not change.
        longitudes = np.arctan2(points[:, 1], points[:, 0])
        down = interpolate_along_edge(longitudes, upper, pressed) / 2 * falloff
        out = interpolate_along_edge(longitudes, upper, forth) * falloff
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
    """(U,) radians by which the edges overlap too much; takes them out of each other."""
    pressed = np.zeros(upper)
    for _ in range(_ROUNDS):
        too_far = edge_overlap(edges[:upper], edges[upper:]) - full_overlap
        if (too_far < _ALLOWED).all():
            break
        # Either lid gives way by half.
        too_far = np.maximum(too_far, 0.0)
        pressed += too_far
        back = interpolate_along_edge(edges[:, 0], upper, too_far) * falloff[: len(edges)] / 2
        edges[:, 1] += np.where(on_upper[: len(edges)], back, -back)
    return pressed


@njit(cache=True, nogil=True)
def _rising(values: Array) -> Array:
    """Nowhere falling, as interpolation wants it; edges double back by a hair at the corners."""
    rising = values.copy()
    for n in range(1, len(rising)):
        rising[n] = max(rising[n], rising[n - 1])
    return rising
