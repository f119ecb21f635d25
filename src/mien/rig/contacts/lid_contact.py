"""Two lids and an eyeball in numbers: where the lids are on it, and how they get off each other.

A place is longitude and latitude, radians, and radius on the unit sphere that the eyeball is an
image of (rig.contacts.lids); an edge is the places of its vertices from one corner to the other.
"""

from __future__ import annotations

import math

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.numeric.kernels.jit import njit

_ALLOWED = 1e-6
_ROUNDS = 4


@njit(cache=True, nogil=True)
def places_of(points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """(N, 3) places of points, told ahead, along and up from the middle of the sphere."""
    places = np.empty_like(points)
    for n in range(len(points)):
        ahead, along, up = points[n]
        flat = math.hypot(ahead, along)
        places[n, 0] = math.atan2(along, ahead)
        places[n, 1] = math.atan2(up, flat)
        places[n, 2] = math.hypot(flat, up)
    return places


@njit(cache=True, nogil=True)
def edge_overlap(upper: Float[Array, "u 3"], lower: Float[Array, "w 3"]) -> Float[Array, " u"]:
    """(U,) radians by which the upper edge's vertices lie below the lower edge."""
    return np.interp(upper[:, 0], _rising(lower[:, 0]), lower[:, 1]) - upper[:, 1]


@njit(cache=True, nogil=True)
def off_lower(
    upper: Float[Array, "u 3"], lower: Float[Array, "w 3"], in_front: Float[Array, " u"]
) -> Float[Array, " u"]:
    """(U,) change of radius that lays the upper edge's vertices just before the lower edge."""
    return np.interp(upper[:, 0], _rising(lower[:, 0]), lower[:, 2]) + in_front - upper[:, 2]


@njit(cache=True, nogil=True)
def along_edge(
    longitudes: Float[Array, " n"], upper: int, corrections: Float[Array, " u"]
) -> Float[Array, " n"]:
    """(N,) what corrections along the upper edge, whose vertices are the first, are elsewhere."""
    along = np.interp(longitudes, _rising(longitudes[:upper]), corrections)
    # Close to a corner the edge doubles back, and its longitude tells no place on it.
    along[:upper] = corrections
    return along


@njit(cache=True, nogil=True)
def move_apart(
    points: Float[Array, "l 3"],
    upper: int,
    lower: int,
    share: Float[Array, " l"],
    on_upper: Bool[Array, " l"],
    least: Float[Array, " l"],
    full_overlap: Float[Array, " u"],
    in_front: Float[Array, " u"],
    firmness: float,
    moves: Float[Array, "l 3"],
) -> bool:
    """How points of the lids move out of each other and out of the sphere, if any does.

    Args:
        points: on the lids, told as in places_of; the edges first.
        upper: of rig.contacts.lids.Lids.
        lower: of rig.contacts.lids.Lids.
        share: of rig.contacts.lids.Lids.
        on_upper: of rig.contacts.lids.Lids.
        least: of rig.contacts.lids.Lids.
        full_overlap: of rig.contacts.lids.Lids.
        in_front: of rig.contacts.lids.Lids.
        firmness: how firmly lids lie on each other that overlap by a radian too much.
        moves: (L, 3) zeros, where to write.
    """
    edges = places_of(points[: upper + lower])
    high, low = edges[:upper], edges[upper:]
    pressed = _press(edges, upper, share, on_upper, full_overlap)
    touching = pressed.any()
    firmly = np.minimum(pressed * firmness, 1.0)
    forth = off_lower(high, low, in_front) * firmly
    if touching:
        # What a vertex gives way by follows from its longitude, which does not change.
        longitudes = np.arctan2(points[:, 1], points[:, 0])
        down = along_edge(longitudes, upper, pressed) / 2 * share
        out = along_edge(longitudes, upper, forth) * share
    moved = False
    for n in range(len(points)):
        ahead, along, up = points[n]
        flat = math.sqrt(ahead * ahead + along * along)
        radius = math.sqrt(flat * flat + up * up)
        turn, rise = 0.0, 0.0
        if touching:
            turn = down[n] if on_upper[n] else -down[n]
            rise = out[n] if on_upper[n] else 0.0
        if radius + rise < least[n] - _ALLOWED:
            rise = least[n] - radius
        if turn == 0 and rise == 0:
            continue
        latitude = math.atan2(up, flat) + turn
        level = (radius + rise) * math.cos(latitude) / flat
        moves[n, 0], moves[n, 1] = ahead * (level - 1), along * (level - 1)
        moves[n, 2] = (radius + rise) * math.sin(latitude) - up
        moved = True
    return moved


@njit(cache=True, nogil=True)
def _press(edges: Array, upper: int, share: Array, on_upper: Array, full_overlap: Array) -> Array:
    """(U,) radians by which the edges overlap too much; takes them out of each other."""
    pressed = np.zeros(upper)
    for _ in range(_ROUNDS):
        too_far = edge_overlap(edges[:upper], edges[upper:]) - full_overlap
        if (too_far < _ALLOWED).all():
            break
        # Either lid gives way by half.
        too_far = np.maximum(too_far, 0.0)
        pressed += too_far
        back = along_edge(edges[:, 0], upper, too_far) * share[: len(edges)] / 2
        edges[:, 1] += np.where(on_upper[: len(edges)], back, -back)
    return pressed


@njit(cache=True, nogil=True)
def _rising(values: Array) -> Array:
    """Nowhere falling, as interpolation wants it; edges double back by a hair at the corners."""
    rising = values.copy()
    for n in range(1, len(rising)):
        rising[n] = max(rising[n], rising[n - 1])
    return rising
