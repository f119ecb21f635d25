"""Eyelids: contacts with the eyeball and of the upper with the lower lid.

Computed in spherical coordinates on the unit sphere that the eyeball is an affine image of:
longitude from the inner to the outer eye corner, latitude across, and the radius.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.assets.generic import GenericHead
from mien.rig.contacts.lid_contact import (
    edge_overlap,
    interpolate_along_edge,
    radius_change,
    resolve_lid_contact,
    to_spherical,
)
from mien.rig.gaze import SIDES, Eyeball
from mien.rig.skin_paths import (
    behind_margin,
    cosine_falloff,
    geodesic_distances,
    shortest_path,
    skin_edges,
)

_CLEARANCE_MM = 0.4
"""Least distance from the eyeball of a lid that is further off at rest."""
_OVERLAP_MM = 0.35
"""How far a closed upper lid overlaps the lower one's edge, so that no crack shows."""
_IN_FRONT_MM = 0.15
"""How far its edge then lies in front of the lower one's."""
_REACH_MM = 14.0
"""Distance over the closed lid at which a correction of its edge has faded out."""
_BALL_MM = 18.0
"""Skin further off the eyeball is not part of the lids."""
_FULL_CONTACT_MM = 0.5
"""Excess overlap from which on the lids lie on each other."""
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
        falloff: (L,) weight of a correction of the nearer edge.
        on_upper: (L,) whether the nearer edge is the upper one.
        min_radius: (L,) a smaller radius is in the eyeball; the radius at rest if that is
            less; 0 on the back of the lids, which is not tested.
        axes: (3, 3) rows: towards the middle of the lids, towards the outer corner, upwards.
    """

    eyeball: Eyeball
    vertices: Int[Array, " l"]
    upper: int
    lower: int
    falloff: Float[Array, " l"]
    on_upper: Bool[Array, " l"]
    min_radius: Float[Array, " l"]
    axes: Float[Array, "3 3"]

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"], side: str) -> Lids:
        """The left or the right eye's lids of a head with these neutral vertices, (V, 3) mm."""
        eyeball = Eyeball.of(generic, vertices, side)
        blink = generic.unit_offsets[generic.unit_names.index(f"eyeBlink{side.capitalize()}")]
        edges = skin_edges(generic, generic.mesh.vertices)
        upper, lower = (
            shortest_path(edges, generic.polylines[f"{side}_{which}_eyelid"])
            for which in ("upper", "lower")
        )
        closed = skin_edges(generic, generic.mesh.vertices + blink)
        distance, nearest = geodesic_distances(closed, np.concatenate([upper, lower[1:-1]]))
        around = np.flatnonzero(distance < 2 * _REACH_MM)
        off = np.linalg.norm(eyeball.on_sphere(vertices[around]), axis=1) - 1
        around = around[(off < _BALL_MM / eyeball.radius) & (off > -0.5)]
        inner = np.setdiff1d(around, np.concatenate([upper, lower]))
        chosen = np.concatenate([upper, lower, inner])
        falloff = cosine_falloff(distance[chosen], _REACH_MM)
        on_upper = np.isin(nearest[chosen], upper)
        axes = _axes(eyeball.on_sphere(vertices[upper[[0, -1]]]))
        radius = np.linalg.norm(eyeball.on_sphere(vertices[chosen]), axis=1)
        min_radius = np.minimum(radius, 1 + _CLEARANCE_MM / eyeball.radius)
        back = behind_margin(edges, np.concatenate([upper, lower]), generic.vertex_of("nose_tip"))
        min_radius[np.isin(chosen, back)] = 0.0
        return Lids(
            eyeball=eyeball,
            vertices=frozen(chosen),
            upper=len(upper),
            lower=len(lower),
            falloff=frozen(falloff),
            on_upper=frozen(on_upper),
            min_radius=frozen(min_radius),
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

    def spherical(self, vertices: Float[Array, "v 3"]) -> Float[Array, "l 3"]:
        """(L, 3) longitude and latitude, radians, and radius of the lids."""
        return to_spherical((vertices[self.vertices] - self.eyeball.centre) @ self.to_sphere)

    def from_spherical(self, coordinates: Float[Array, "l 3"]) -> Float[Array, "l 3"]:
        """(L, 3) mm: the inverse of spherical."""
        longitude, latitude, radius = coordinates.T
        points = np.column_stack(
            [
                np.cos(latitude) * np.cos(longitude),
                np.cos(latitude) * np.sin(longitude),
                np.sin(latitude),
            ]
        )
        return (radius[:, None] * points) @ self.from_sphere + self.eyeball.centre

    def overlap(self, coordinates: Float[Array, "l 3"]) -> Float[Array, " u"]:
        """(U,) radians by which the upper edge's vertices lie below the lower edge."""
        return edge_overlap(*self.edges(coordinates))

    def edges(self, coordinates: Float[Array, "l 3"]) -> tuple[Array, Array]:
        """The upper and the lower edge's coordinates, from the inner to the outer corner."""
        return coordinates[: self.upper], coordinates[self.upper : self.upper + self.lower]

    @cached_property
    def full_overlap(self) -> Float[Array, " u"]:
        """(U,) radians: overlap of closed lids; 0 at the corners, which both share."""
        shape = np.sin(np.linspace(0, np.pi, self.upper)) ** 0.5
        return frozen(_OVERLAP_MM / self.eyeball.radius * shape)

    @cached_property
    def in_front(self) -> Float[Array, " u"]:
        """(U,) difference of radius by which closed upper lids lie in front of the lower ones."""
        return frozen(self.full_overlap * (_IN_FRONT_MM / _OVERLAP_MM))

    def spread(
        self, coordinates: Float[Array, "l 3"], corrections: Float[Array, " u"]
    ) -> Float[Array, " l"]:
        """(L,) corrections along the upper edge, extended over both lids."""
        along: Array = interpolate_along_edge(coordinates[:, 0], self.upper, corrections)
        return along * self.falloff


def close_lids(
    generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
) -> Float[Array, "52 v 3"]:
    """The units with lids that close at eyeBlink 1 and never enter the eyeball.

    Args:
        generic: its topology and unit names.
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
                coordinates = lids.spherical(posed)
                if (coordinates[:, 2] < lids.min_radius).any():
                    offsets[lids.vertices] += _lift(lids, coordinates) / weight
    return result


def _closing(lids: Lids, vertices: Float[Array, "v 3"]) -> Float[Array, "l 3"]:
    """(L, 3) mm that moves the upper edge onto the lower one, just over and in front of it."""
    before = lids.spherical(vertices)
    coordinates = before.copy()
    coordinates[:, 2] = np.maximum(coordinates[:, 2], lids.min_radius)
    down = lids.overlap(coordinates) - lids.full_overlap
    coordinates[:, 1] += lids.spread(coordinates, down) * lids.on_upper
    off = radius_change(*lids.edges(coordinates), lids.in_front)
    coordinates[:, 2] += lids.spread(coordinates, off) * lids.on_upper
    return lids.from_spherical(coordinates) - lids.from_spherical(before)


def _lift(lids: Lids, coordinates: Float[Array, "l 3"]) -> Float[Array, "l 3"]:
    """(L, 3) mm out of the eyeball."""
    lifted = coordinates.copy()
    lifted[:, 2] = np.maximum(coordinates[:, 2], lids.min_radius)
    return lids.from_spherical(lifted) - lids.from_spherical(coordinates)


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

    The position of the eyeball is taken from its vertices.
    """
    ball = vertices[lids.eyeball.vertices]
    points = (vertices[lids.vertices] - ball.sum(axis=0) / len(ball)) @ lids.to_sphere
    moves = np.zeros_like(points)
    touching = resolve_lid_contact(
        points,
        lids.upper,
        lids.lower,
        lids.falloff,
        lids.on_upper,
        lids.min_radius,
        lids.full_overlap,
        lids.in_front,
        lids.eyeball.radius / _FULL_CONTACT_MM,
        moves,
    )
    return moves @ lids.from_sphere if touching else None
