"""Eyelids: they ride on the eyeballs, and upper and lower one meet without passing each other.

A lid's place is told on the unit sphere that the eyeball is an image of: longitude from the inner
to the outer eye corner, latitude across, and the radius.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.generic import GenericHead
from mien.rig.contacts.lid_contact import (
    along_edge,
    edge_overlap,
    move_apart,
    off_lower,
    places_of,
)
from mien.rig.contacts.margins import behind, distances_from, fading, full_path, skin_edges
from mien.rig.gaze import SIDES, Eyeball

_CLEARANCE_MM = 0.4
"""How far off the eyeball a lid stays that is further off at rest."""
_OVERLAP_MM = 0.35
"""How far a closed upper lid reaches over the lower one's edge: no crack between two polygons."""
_IN_FRONT_MM = 0.15
"""How far its edge then lies before the lower one's."""
_REACH_MM = 14.0
"""How far over the closed lid a correction of its edge fades out."""
_BALL_MM = 18.0
"""Skin further off the eyeball has nothing to do with it."""
_FIRM_MM = 0.5
"""Lids that would overlap by this much more lie on each other."""
_STEPS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Lids:
    """The lids of one eye of one head.

    Attributes:
        eyeball: where it is when the face is neutral.
        vertices: (L,) the skin on and around the lids, the edges first: upper, then lower.
        upper: how many vertices the upper and the lower edge have, from the inner to the outer
            corner, both of which are in both.
        lower: as `upper`.
        share: (L,) how far a correction of the nearer edge goes along.
        on_upper: (L,) whether that is the upper one.
        least: (L,) radius below which a vertex is in the eyeball; its own at rest if that is less;
            0 on the back of the lids, which may be.
        axes: (3, 3) rows: towards the middle of the lids, towards the outer corner, upwards.
    """

    eyeball: Eyeball
    vertices: Int[Array, " l"]
    upper: int
    lower: int
    share: Float[Array, " l"]
    on_upper: Bool[Array, " l"]
    least: Float[Array, " l"]
    axes: Float[Array, "3 3"]

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"], side: str) -> Lids:
        """The left or the right eye's lids of a head with these neutral vertices, (V, 3) mm."""
        eyeball = Eyeball.of(generic, vertices, side)
        blink = generic.unit_offsets[generic.unit_names.index(f"eyeBlink{side.capitalize()}")]
        edges = skin_edges(generic, generic.mesh.vertices)
        upper, lower = (
            full_path(edges, generic.polylines[f"{side}_{which}_eyelid"])
            for which in ("upper", "lower")
        )
        closed = skin_edges(generic, generic.mesh.vertices + blink)
        distance, nearest = distances_from(closed, np.concatenate([upper, lower[1:-1]]))
        around = np.flatnonzero(distance < 2 * _REACH_MM)
        off = np.linalg.norm(eyeball.on_sphere(vertices[around]), axis=1) - 1
        around = around[(off < _BALL_MM / eyeball.radius) & (off > -0.5)]
        inner = np.setdiff1d(around, np.concatenate([upper, lower]))
        chosen = np.concatenate([upper, lower, inner])
        share = fading(distance[chosen], _REACH_MM)
        on_upper = np.isin(nearest[chosen], upper)
        axes = _axes(eyeball.on_sphere(vertices[upper[[0, -1]]]))
        radius = np.linalg.norm(eyeball.on_sphere(vertices[chosen]), axis=1)
        least = np.minimum(radius, 1 + _CLEARANCE_MM / eyeball.radius)
        back = behind(edges, np.concatenate([upper, lower]), generic.vertex_of("nose_tip"))
        least[np.isin(chosen, back)] = 0.0
        return Lids(
            eyeball=eyeball,
            vertices=frozen(chosen),
            upper=len(upper),
            lower=len(lower),
            share=frozen(share),
            on_upper=frozen(on_upper),
            least=frozen(least),
            axes=axes,
        )

    @cached_property
    def to_sphere(self) -> Float[Array, "3 3"]:
        """Takes rows from mm, the eyeball's centre as origin, to the unit sphere and its axes."""
        return frozen(self.eyeball.inverse.T @ self.axes.T)

    @cached_property
    def from_sphere(self) -> Float[Array, "3 3"]:
        """The inverse of to_sphere."""
        return frozen(self.axes @ self.eyeball.shape.T)

    def places(self, vertices: Float[Array, "v 3"]) -> Float[Array, "l 3"]:
        """(L, 3) longitude and latitude, radians, and radius of the lids on the unit sphere."""
        return places_of((vertices[self.vertices] - self.eyeball.centre) @ self.to_sphere)

    def at(self, places: Float[Array, "l 3"]) -> Float[Array, "l 3"]:
        """(L, 3) mm: the inverse of places."""
        longitude, latitude, radius = places.T
        points = np.column_stack(
            [
                np.cos(latitude) * np.cos(longitude),
                np.cos(latitude) * np.sin(longitude),
                np.sin(latitude),
            ]
        )
        return (radius[:, None] * points) @ self.from_sphere + self.eyeball.centre

    def overlap(self, places: Float[Array, "l 3"]) -> Float[Array, " u"]:
        """(U,) radians by which the upper edge's vertices lie below the lower edge."""
        return edge_overlap(*self.edges(places))

    def edges(self, places: Float[Array, "l 3"]) -> tuple[Array, Array]:
        """The upper and the lower edge's places, from the inner to the outer corner."""
        return places[: self.upper], places[self.upper : self.upper + self.lower]

    @cached_property
    def full_overlap(self) -> Float[Array, " u"]:
        """(U,) radians: that of closed lids; none at the corners, where both are one."""
        shape = np.sin(np.linspace(0, np.pi, self.upper)) ** 0.5
        return frozen(_OVERLAP_MM / self.eyeball.radius * shape)

    @cached_property
    def in_front(self) -> Float[Array, " u"]:
        """(U,) by how much more radius closed upper lids lie before the lower ones."""
        return frozen(self.full_overlap * (_IN_FRONT_MM / _OVERLAP_MM))

    def spread(
        self, places: Float[Array, "l 3"], corrections: Float[Array, " u"]
    ) -> Float[Array, " l"]:
        """(L,) what corrections along the upper edge are elsewhere on both lids."""
        along: Array = along_edge(places[:, 0], self.upper, corrections)
        return along * self.share


def close_lids(
    generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
) -> Float[Array, "52 v 3"]:
    """The units with lids that close at eyeBlink 1 and never enter the eyeball.

    Args:
        vertices: (V, 3) mm, the neutral face.
        units: (52, V, 3) mm, as transferred.
    """
    result = np.asarray(units, np.float64).copy()
    for side in SIDES:
        lids = Lids.of(generic, vertices, side)
        for unit, offsets in enumerate(result):
            if not np.abs(offsets[lids.vertices]).max() > 0:
                continue
            if generic.unit_names[unit] == f"eyeBlink{side.capitalize()}":
                offsets[lids.vertices] += _closing(lids, vertices + offsets)
            for weight in _STEPS:
                posed = vertices + weight * offsets
                places = lids.places(posed)
                if (places[:, 2] < lids.least).any():
                    offsets[lids.vertices] += _lift(lids, places) / weight
    return result


def _closing(lids: Lids, vertices: Float[Array, "v 3"]) -> Float[Array, "l 3"]:
    """(L, 3) mm that lays the upper edge along the lower one, just over and before it."""
    before = lids.places(vertices)
    places = before.copy()
    places[:, 2] = np.maximum(places[:, 2], lids.least)
    down = lids.overlap(places) - lids.full_overlap
    places[:, 1] += lids.spread(places, down) * lids.on_upper
    off = off_lower(*lids.edges(places), lids.in_front)
    places[:, 2] += lids.spread(places, off) * lids.on_upper
    return lids.at(places) - lids.at(before)


def _lift(lids: Lids, places: Float[Array, "l 3"]) -> Float[Array, "l 3"]:
    """(L, 3) mm out of the eyeball."""
    lifted = places.copy()
    lifted[:, 2] = np.maximum(places[:, 2], lids.least)
    return lids.at(lifted) - lids.at(places)


def _axes(corners: Float[Array, "2 3"]) -> Float[Array, "3 3"]:
    """Rows: ahead between the corners, along towards the outer one, up; all at right angles."""
    inner, outer = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    ahead = (inner + outer) / np.linalg.norm(inner + outer)
    along = outer - (outer @ ahead) * ahead
    along /= np.linalg.norm(along)
    up = np.cross(along, ahead)
    return np.array([ahead, along, up * np.sign(up[1])])


def resolve_lids(lids: Lids, vertices: Float[Array, "v 3"]) -> Float[Array, "l 3"] | None:
    """(L, 3) mm that takes the lids out of each other and out of the eyeball; None: no contact.

    The eyeball may have been carried elsewhere; it is taken to be where its vertices are.
    """
    ball = vertices[lids.eyeball.vertices]
    points = (vertices[lids.vertices] - ball.sum(axis=0) / len(ball)) @ lids.to_sphere
    moves = np.zeros_like(points)
    touching = move_apart(
        points,
        lids.upper,
        lids.lower,
        lids.share,
        lids.on_upper,
        lids.least,
        lids.full_overlap,
        lids.in_front,
        lids.eyeball.radius / _FIRM_MM,
        moves,
    )
    return moves @ lids.from_sphere if touching else None
