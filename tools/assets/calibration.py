"""How strong the identity basis has to be, so that random heads differ as people do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Float, Int
from mien.numeric.similarity import estimate_similarity

# The mean head lies 1.6 and 0.9 mm (as `median_distance` measures, the face's vertices against the
# scan) from the faces of two real scans; a random head shall lie as far from it.
REAL_MEDIAN_MM = 1.2
_ROUNDS = 12
_DROPPED = 0.05


@dataclass(frozen=True)
class Surface:
    """Points spread over a surface with their normals.

    Attributes:
        points: (N, 3) mm; unit.
        normals: (N, 3) mm; unit.
    """

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]


def sample_surface(
    vertices: Float[Array, "v 3"], triangles: Int[Array, "f 3"], per_side: int = 4
) -> Surface:
    """A regular grid of points on every triangle."""
    steps = (np.arange(per_side) + 1 / 3) / per_side
    grid = np.array([(1 - u - v, u, v) for u in steps for v in steps if u + v < 1])
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    points = np.einsum("gk,fkc->fgc", grid, corners)
    return Surface(points.reshape(-1, 3), np.repeat(normals, len(grid), axis=0))


def median_distance(shape: Float[Array, "n 3"], surface: Surface, tree: cKDTree) -> float:
    """Median distance in mm of points from a surface after aligning them by a similarity and ICP.

    The worst 5 % are left out while aligning and kept while reporting.
    """
    aligned = shape
    for _ in range(_ROUNDS):
        distance, nearest = tree.query(aligned)
        kept = distance <= np.quantile(distance, 1 - _DROPPED)
        aligned = estimate_similarity(aligned[kept], surface.points[nearest[kept]])(aligned)
    _, nearest = tree.query(aligned)
    gaps = ((aligned - surface.points[nearest]) * surface.normals[nearest]).sum(1)
    return float(np.median(np.abs(gaps)))


def find_amplitude(
    mean: Float[Array, "v 3"],
    components: Float[Array, "k v 3"],
    face: Int[Array, " n"],
    surface: Surface,
    rng: np.random.Generator,
    *,
    heads: int = 30,
) -> float:
    """The factor on the components at which random heads differ from the mean as people do.

    Args:
        face: vertices of the face, whose distances count.
        surface: the mean head's.
    """
    tree = cKDTree(surface.points)
    offsets = np.tensordot(rng.normal(size=(heads, len(components))), components[:, face], axes=1)
    amplitude = 1.0
    for _ in range(3):
        medians = [
            median_distance(mean[face] + amplitude * offset, surface, tree) for offset in offsets
        ]
        amplitude *= REAL_MEDIAN_MM / float(np.mean(medians))
    return amplitude
