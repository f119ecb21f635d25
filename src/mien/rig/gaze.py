"""Gaze: eyeballs rotate about their own centres and the lids follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float, Int, frozen
from mien.assets.generic import GenericHead
from mien.numeric.kernels.jit import njit

SIDES = ("left", "right")
_LID_GAIN = 0.35
"""How far lids follow a gaze beyond weight 1 of the units; with 1 they would close too early."""
_DIRECTIONS = ("Down", "In", "Out", "Up")
EYE_LOOK_UNITS = tuple(
    f"eyeLook{direction}{side.capitalize()}" for direction in _DIRECTIONS for side in SIDES
)
"""The units that rotate the eyeballs."""


@dataclass(frozen=True)
class Eyeball:
    """One eyeball in its socket: an ellipsoid, the affine image of the generic head's sphere.

    Attributes:
        vertices: (B,) its vertices.
        centre: (3,) mm.
        shape: (3, 3) maps the unit sphere around the origin to the eyeball around its centre. The
            vertex furthest out lies on it: cornea and facets are inside.
    """

    vertices: Int[Array, " b"]
    centre: Float[Array, " 3"]
    shape: Float[Array, "3 3"]

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"], side: str) -> Eyeball:
        """The left or the right eyeball of a head with these vertices, (V, 3) mm."""
        ball = generic.mesh.vertices_of(f"{side}_eyeball")
        source = generic.mesh.vertices[ball] - generic.mesh.vertices[ball].mean(axis=0)
        centre = vertices[ball].mean(axis=0)
        linear = np.linalg.lstsq(source, vertices[ball] - centre, rcond=None)[0].T
        reach = np.linalg.norm((vertices[ball] - centre) @ np.linalg.inv(linear).T, axis=1).max()
        return Eyeball(frozen(ball), frozen(centre), frozen(linear * reach))

    @cached_property
    def radius(self) -> float:
        """mm, of the sphere of the same volume."""
        return float(np.abs(np.linalg.det(self.shape)) ** (1 / 3))

    @cached_property
    def inverse(self) -> Float[Array, "3 3"]:
        """The inverse of shape."""
        return frozen(np.linalg.inv(self.shape))

    def on_sphere(self, points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """(N, 3) the points in the space where the eyeball is the unit sphere."""
        return (points - self.centre) @ self.inverse.T

    def turned(self, points: Float[Array, "n 3"], yaw: float, pitch: float) -> Float[Array, "n 3"]:
        """(N, 3) mm: points of the eyeball rotated from straight ahead to this gaze (radians).

        The smallest rotation (Listing's law) of the sphere that the eyeball is an affine image of:
        a round eyeball moves rigidly, an ellipsoid along its own surface, so that lids stay on it.
        """
        if yaw == 0 and pitch == 0:
            return points
        return _turned(points, self.shape, self.inverse, yaw, pitch)


@njit(cache=True, nogil=True)
def _turned(points: Array, shape: Array, inverse: Array, yaw: float, pitch: float) -> Array:
    linear = shape @ _turn(inverse, yaw, pitch) @ inverse
    middle = points.sum(axis=0) / len(points)
    return middle + (points - middle) @ linear.T


@njit(cache=True, nogil=True)
def _turn(inverse: Array, yaw: float, pitch: float) -> Array:
    """(3, 3) rotation of the unit sphere by Rodrigues' formula."""
    towards = (np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch))
    before, after = inverse[:, 2].copy(), np.zeros(3)
    for axis in range(3):
        after += inverse[:, axis] * towards[axis]
    before /= np.sqrt((before**2).sum())
    after /= np.sqrt((after**2).sum())
    around, cosine = np.cross(before, after), (before * after).sum()
    x, y, z = around
    turn = np.array([[cosine, -z, y], [z, cosine, -x], [-y, x, cosine]])
    for row in range(3):
        turn[row] += around[row] * around / max(1 + cosine, 1e-9)
    return turn


def eye_look_angles(generic: GenericHead) -> dict[str, tuple[float, float]]:
    """Yaw and pitch, radians, by which each eyeLook unit rotates its eyeball at weight 1.

    Those of the rotation nearest to the generic unit's offsets.
    """
    angles = {}
    for name in EYE_LOOK_UNITS:
        ball = generic.mesh.vertices_of(f"{_side(name)}_eyeball")
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
    """The units with eyeballs that rotate about their centres.

    An eyeLook unit is exact at weight 1; in between it is the chord of the rotation.
    """
    result = units.copy()
    for name, (yaw, pitch) in eye_look_angles(generic).items():
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
class GazeModel:
    """How gaze and eyeLook units rotate the eyeballs of one head.

    Attributes:
        eyeballs: left and right.
        units: (8,) indices of the eyeLook units, in the order of EYE_LOOK_UNITS.
        angles: (8, 2) yaw and pitch, radians, of the eyeballs at weight 1 of these.
    """

    eyeballs: tuple[Eyeball, Eyeball]
    units: Int[Array, " 8"]
    angles: Float[Array, "8 2"]

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"]) -> GazeModel:
        """For a head with these neutral vertices, mm."""
        left, right = (Eyeball.of(generic, vertices, side) for side in SIDES)
        chosen = [generic.unit_names.index(name) for name in EYE_LOOK_UNITS]
        angles = eye_look_angles(generic)
        return GazeModel(
            (left, right),
            frozen(np.array(chosen)),
            frozen(np.array([angles[name] for name in EYE_LOOK_UNITS])),
        )

    def without_eyeballs(self, units: Float[Array, "52 v 3"]) -> Float[Array, "52 v 3"]:
        """Unit offsets whose eyeLook units do not move the eyeballs."""
        result = np.array(units)
        for eyeball in self.eyeballs:
            result[np.ix_(self.units, eyeball.vertices)] = 0
        return result

    def motion(
        self, units: Float[Array, " u"], gaze: Float[Array, " 2"]
    ) -> tuple[Float[Array, " u"], Float[Array, "2 2"]]:
        """Unit weights and eyeball angles that follow from units and a gaze (yaw, pitch, radians).

        Returns:
            (U,) weights of the units' offsets, lids following the gaze; (2, 2) rad, yaw
            and pitch of the left and the right eyeball.
        """
        given, weights = units[self.units], units.copy()
        weights[self.units] += self._lid_weights(gaze)
        sides = range(len(self.eyeballs))
        angles = np.array([gaze + given[side::2] @ self.angles[side::2] for side in sides])
        return weights, angles

    def turn(self, vertices: Float[Array, "v 3"], angles: Float[Array, "2 2"]) -> None:
        """Turns the eyeballs of a head, (V, 3) mm, in place, by yaw and pitch of either side."""
        for eyeball, (yaw, pitch) in zip(self.eyeballs, angles.tolist(), strict=True):
            if yaw or pitch:
                ball = eyeball.vertices
                vertices[ball] = eyeball.turned(vertices[ball], yaw, pitch)

    def _lid_weights(self, gaze: Float[Array, " 2"]) -> Float[Array, " 8"]:
        """How far the eyeLook units would turn the eyeballs as the gaze does, less beyond 1."""
        size = (self.angles**2).sum(axis=1)
        shares = np.maximum(self.angles @ gaze / size, 0.0)
        return np.minimum(shares, 1.0) + _LID_GAIN * np.maximum(shares - 1.0, 0.0)


def _side(unit: str) -> str:
    return "left" if unit.endswith("Left") else "right"
