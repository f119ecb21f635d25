"""What is known of a head's shape beforehand: identity, smooth deviations, near symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.assets.generic import GenericHead

SYMMETRIC_SD_MM = 2.0
"""How far, along each axis, the two sides of a face together lie off the identity basis."""
ASYMMETRIC_SD_MM = 0.7
"""How far the one side lies off the mirror image of the other, over the square root of two."""
LENGTH_MM = 35.0
"""Over which such deviations go together: deviation = exp(-d^2 / 2 LENGTH_MM^2)."""
MODES = 40
"""Modes kept for each axis of each kind."""
_CENTRES = 400
_BACK_Z_MM = -120.0
"""Behind this nothing is centred: photos of faces do not show it."""


@dataclass(frozen=True)
class HeadPrior:
    """vertices = mean + coefficients . components, the coefficients independent with deviation 1.

    Attributes:
        mean: (V, 3) mm.
        components: (C, V, 3) mm: the identity basis, then smooth modes.
        identity_count: how many of them are the identity basis.
    """

    mean: Float[Array, "v 3"]
    components: Float[Array, "c v 3"]
    identity_count: int

    def vertices(self, coefficients: Float[Array, " c"]) -> Float[Array, "v 3"]:
        """(V, 3) mm of the head with these coefficients."""
        return self.mean + np.tensordot(coefficients, self.components, 1)


@cache
def load_head_prior() -> HeadPrior:
    """The prior of the generic head that ships with mien, made once."""
    from mien.assets.generic import load_generic_head

    return make_head_prior(load_generic_head())


def make_head_prior(generic: GenericHead) -> HeadPrior:
    """The generic head's identity basis and a Gaussian process of smooth deviations from it.

    A deviation is split into a symmetric half, which a mirror leaves as it is, and an asymmetric
    half of smaller variance. For a coordinate across the mirror the even modes of space make the
    asymmetric half, for the other two the odd ones do.

    Source:
        Luethi et al., Gaussian Process Morphable Models, 2018; the split is ours.
    """
    even, odd = _spatial_modes(generic, +1), _spatial_modes(generic, -1)
    components = [generic.identity.components.astype(np.float64)]
    for axis, (symmetric, asymmetric) in enumerate(((odd, even), (even, odd), (even, odd))):
        for modes, sd in ((symmetric, SYMMETRIC_SD_MM), (asymmetric, ASYMMETRIC_SD_MM)):
            moved = np.zeros((*modes.shape, 3))
            # Even and odd modes carry half of the variance each.
            moved[..., axis] = np.sqrt(2) * sd * modes
            components.append(moved)
    stacked = _without_similarities(np.concatenate(components), generic)
    return HeadPrior(generic.mesh.vertices, frozen(stacked), len(generic.identity.components))


def _without_similarities(
    components: Float[Array, "c v 3"], generic: GenericHead
) -> Float[Array, "c v 3"]:
    """The components less what moves, turns or scales the face as a whole.

    Photos cannot distinguish these from a move of the cameras. Left in, they would leave the joint
    solution's frame and scale to drift; taken out, the mean head fixes both.
    """
    vertices = generic.mesh.vertices
    fields = np.zeros((7, *vertices.shape))
    fields[:3] = np.eye(3)[:, None]
    fields[3:6] = np.cross(np.eye(3)[:, None], vertices)
    fields[6] = vertices
    face = np.sqrt(generic.regions["face"])[:, None]
    held = (fields * face).reshape(7, -1).T
    shares = np.linalg.lstsq(held, (components * face).reshape(len(components), -1).T, rcond=None)[
        0
    ]
    return components - np.tensordot(shares.T, fields, 1)


def _spatial_modes(generic: GenericHead, sign: int) -> Float[Array, "m v"]:
    """(M, V): even (+1) or odd (-1) functions of space, by Nystroem's method."""
    vertices = generic.mesh.vertices
    mirror = np.array([-1.0, 1.0, 1.0])
    centres = vertices[_spread_vertices(generic)]

    def kernel(points: Array) -> Array:
        def value(to: Array) -> Array:
            squared = (points**2).sum(1)[:, None] + (to**2).sum(1) - 2 * points @ to.T
            return np.exp(-np.maximum(squared, 0) / (2 * LENGTH_MM**2))

        return (value(centres) + sign * value(centres * mirror)) / 2

    values, vectors = np.linalg.eigh(kernel(centres))
    chosen = np.argsort(values)[::-1][:MODES]
    modes: Array = kernel(vertices) @ (vectors[:, chosen] / np.sqrt(values[chosen]))
    return modes.T


def _spread_vertices(generic: GenericHead) -> Array:
    """Vertices of one half of the skin, each far from those before it."""
    vertices = generic.mesh.vertices
    skin = generic.mesh.vertices_of("skin")
    half = skin[(vertices[skin, 2] > _BACK_Z_MM) & (vertices[skin, 0] <= 1e-6)]
    chosen, distance = [int(half[0])], np.full(len(half), np.inf)
    for _ in range(_CENTRES - 1):
        step = np.linalg.norm(vertices[half] - vertices[chosen[-1]], axis=1)
        distance = np.minimum(distance, step)
        chosen.append(int(half[distance.argmax()]))
    return np.array(chosen)
