"""Eyes that look around: eyeballs turn about their own centres, lids go with the pupil."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.assets.generic import GenericHead
from mien.expressions.followers import part_vertices
from mien.expressions.state import Gaze
from mien.numeric.rotation import rotation_from_vector

SIDES = ("left", "right")
_LAG = 0.35
"""Of a gaze beyond what the units know, lids follow this share: they would close before it."""
_WAYS = ("Down", "In", "Out", "Up")
LOOK_UNITS = tuple(f"eyeLook{way}{side.capitalize()}" for way in _WAYS for side in SIDES)
"""The units that turn the eyeballs."""


@dataclass(frozen=True)
class Eyeball:
    """One eyeball in its socket: an ellipsoid, the affine image of the generic head's sphere.

    Attributes:
        vertices: (B,) its vertices.
        centre: (3,) mm.
        shape: (3, 3) takes the unit sphere around the origin to the eyeball around its centre.
            Its largest vertex lies on it: cornea and facets are inside.
    """

    vertices: Int[Array, " b"]
    centre: Float[Array, " 3"]
    shape: Float[Array, "3 3"]

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"], side: str) -> Eyeball:
        """The left or the right eyeball of a head with these vertices, (V, 3) mm."""
        ball = part_vertices(generic, f"{side}_eyeball")
        source = generic.mesh.vertices[ball] - generic.mesh.vertices[ball].mean(axis=0)
        centre = vertices[ball].mean(axis=0)
        linear = np.linalg.lstsq(source, vertices[ball] - centre, rcond=None)[0].T
        reach = np.linalg.norm((vertices[ball] - centre) @ np.linalg.inv(linear).T, axis=1).max()
        return Eyeball(frozen(ball), frozen(centre), frozen(linear * reach))

    @property
    def radius(self) -> float:
        """mm: that of the sphere of the same volume."""
        return float(np.abs(np.linalg.det(self.shape)) ** (1 / 3))

    def on_sphere(self, points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """(N, 3) the points where the eyeball is the unit sphere around the origin."""
        inside: Array = (points - self.centre) @ np.linalg.inv(self.shape).T
        return inside

    def turned(self, points: Float[Array, "n 3"], yaw: float, pitch: float) -> Float[Array, "n 3"]:
        """(N, 3) mm: points of the eyeball when it looks there (radians) and not straight ahead.

        The turn takes the shortest way (Listing's law) on the sphere that the eyeball is an image
        of: a round eyeball turns rigidly, one that is not slides along its own surface, so that
        the lids on it stay where they are.
        """
        towards = np.array(
            [np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)]
        )
        before, after = np.linalg.solve(self.shape, np.column_stack([[0, 0, 1], towards])).T
        axis = np.cross(before, after)
        sine = float(np.linalg.norm(axis))
        if sine == 0:
            return points
        angle = np.arctan2(sine, before @ after)
        rotation = rotation_from_vector(axis * (angle / sine))
        middle = points.mean(axis=0)
        linear = self.shape @ rotation @ np.linalg.inv(self.shape)
        result: Array = middle + (points - middle) @ linear.T
        return result


def look_angles(generic: GenericHead) -> dict[str, tuple[float, float]]:
    """Yaw and pitch, radians, by which each eyeLook unit turns its eyeball at weight 1.

    They are those of the rotation nearest to the generic unit's offsets.
    """
    angles = {}
    for name in LOOK_UNITS:
        ball = part_vertices(generic, f"{_side(name)}_eyeball")
        places = generic.mesh.vertices[ball]
        moved = places + generic.unit_offsets[generic.unit_names.index(name)][ball]
        left, _, right = np.linalg.svd(
            (moved - moved.mean(axis=0)).T @ (places - places.mean(axis=0))
        )
        x, y, z = (left @ right)[:, 2]
        yaw = float(np.arctan2(x, z)) if "In" in name or "Out" in name else 0.0
        pitch = float(np.arcsin(y)) if "Down" in name or "Up" in name else 0.0
        angles[name] = (yaw, pitch)
    return angles


def turn_eyeballs(
    generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
) -> Float[Array, "52 v 3"]:
    """The units with eyeballs that turn about their centres and do not leave their surface.

    At weight 1 an eyeLook unit ends where the turn ends; in between it cuts the corner.
    """
    result = units.copy()
    for name, (yaw, pitch) in look_angles(generic).items():
        eyeball = Eyeball.of(generic, vertices, _side(name))
        places = vertices[eyeball.vertices]
        offsets = eyeball.turned(places, yaw, pitch) - places
        result[generic.unit_names.index(name), eyeball.vertices] = offsets
    return result


def with_turned_eyes(
    vertices: Float[Array, "v 3"], gaze: Float[Array, "2 2"], generic: GenericHead
) -> Float[Array, "v 3"]:
    """The head with its eyeballs turned: (2, 2) rad, yaw and pitch of the left and the right."""
    result = vertices.copy()
    for side, (yaw, pitch) in zip(SIDES, gaze.tolist(), strict=True):
        eyeball = Eyeball.of(generic, vertices, side)
        result[eyeball.vertices] = eyeball.turned(vertices[eyeball.vertices], yaw, pitch)
    return result


@dataclass(frozen=True)
class Look:
    """How the eyes of one head look around.

    Attributes:
        eyeballs: left and right.
        units: (8, V, 3) mm: offsets of the eyeLook units, in the order of LOOK_UNITS.
        angles: (8, 2) yaw and pitch, radians, of the eyeballs at weight 1.
    """

    eyeballs: tuple[Eyeball, Eyeball]
    units: Float[Array, "8 v 3"]
    angles: Float[Array, "8 2"]

    @staticmethod
    def of(
        generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
    ) -> Look:
        """For a head with these neutral vertices and these 52 unit offsets, mm."""
        left, right = (Eyeball.of(generic, vertices, side) for side in SIDES)
        chosen = [generic.unit_names.index(name) for name in LOOK_UNITS]
        angles = look_angles(generic)
        return Look(
            (left, right),
            frozen(np.asarray(units, np.float64)[chosen]),
            frozen(np.array([angles[name] for name in LOOK_UNITS])),
        )

    def applied(
        self, vertices: Float[Array, "v 3"], units: Mapping[str, float], gaze: Gaze
    ) -> Float[Array, "v 3"]:
        """(V, 3) mm: the face when it looks there; the same array when it looks straight ahead.

        Args:
            vertices: (V, 3) mm with all units added as offsets, the eyeLook units too.
            units: weights of all units by name; those of the eyeLook units turn the eyeballs, and
                what they added to the eyeballs as offsets is taken back.
            gaze: radians; adds to what the units say, and takes the lids along.
        """
        weights = np.array([units.get(name, 0.0) for name in LOOK_UNITS])
        follow = self._lid_weights(gaze)
        if not (weights.any() or follow.any()):
            return vertices
        result = check_array("vertices", vertices, self.units.shape[1:]).copy()
        if follow.any():
            result += np.tensordot(follow, self.units, axes=1)
        total = weights + follow
        for index, eyeball in enumerate(self.eyeballs):
            mine = np.arange(len(LOOK_UNITS)) % 2 == index
            ball = eyeball.vertices
            places = result[ball] - np.tensordot(total[mine], self.units[mine][:, ball], axes=1)
            yaw, pitch = weights[mine] @ self.angles[mine] + (gaze.yaw, gaze.pitch)
            result[ball] = eyeball.turned(places, float(yaw), float(pitch))
        return result

    def _lid_weights(self, gaze: Gaze) -> Float[Array, " 8"]:
        """How far the eyeLook units would turn the eyeballs as the gaze does, lagging beyond 1."""
        wanted = np.array([gaze.yaw, gaze.pitch])
        size = (self.angles**2).sum(axis=1)
        shares = np.maximum(self.angles @ wanted / size, 0.0)
        lagging: Array = np.minimum(shares, 1.0) + _LAG * np.maximum(shares - 1.0, 0.0)
        return lagging


def _side(unit: str) -> str:
    return "left" if unit.endswith("Left") else "right"
