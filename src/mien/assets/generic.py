"""The generic head: the mesh that every person's head is a deformation of."""

from __future__ import annotations

from dataclasses import dataclass

from mien.arrays import Array, Bool, Float, Int
from mien.mesh import Mesh


@dataclass(frozen=True)
class IdentityBasis:
    """How heads differ from the generic one: vertices = generic + coefficients . components.

    Attributes:
        components: (K, V, 3) mm, scaled so that a person's coefficients are independent with mean
            0 and standard deviation 1: the sum of their squares is a prior.
    """

    components: Float[Array, "k v 3"]

    def offsets(self, coefficients: Float[Array, " k"]) -> Float[Array, "v 3"]:
        """(V, 3) mm to add to the generic head's vertices."""
        raise NotImplementedError


@dataclass(frozen=True)
class GenericHead:
    """The generic head and what is drawn on it.

    Attributes:
        mesh: head space, scaled to an interpupillary distance of 63 mm.
        mirror: (V,) index of each vertex's left-right partner (its own on the midline).
        unit_names: the 52 ARKit names, sorted.
        unit_offsets: (52, V, 3) mm, added to the vertices at weight 1.
        identity: how heads differ.
        regions: soft masks by name, (V,) in [0, 1].
        points: P02's 13 points: vertex index by name.
        polylines: vertex indices along each feature curve, by name.
        landmark_triangles: (478,) index of the triangle under each detector landmark.
        landmark_barycentrics: (478, 3) place in it.
        landmark_attached: (478,) False where the detector's point has no place on the mesh.
    """

    mesh: Mesh
    mirror: Int[Array, " v"]
    unit_names: tuple[str, ...]
    unit_offsets: Float[Array, "52 v 3"]
    identity: IdentityBasis
    regions: dict[str, Float[Array, " v"]]
    points: dict[str, int]
    polylines: dict[str, tuple[int, ...]]
    landmark_triangles: Int[Array, " 478"]
    landmark_barycentrics: Float[Array, "478 3"]
    landmark_attached: Bool[Array, " 478"]


def load_generic_head() -> GenericHead:
    """The generic head that ships with mien, read once and kept."""
    raise NotImplementedError
