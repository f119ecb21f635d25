"""The whole head moved by what is known of its feature points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.mesh import Mesh
from mien.numeric.rbf import fit_rbf
from mien.numeric.similarity import estimate_similarity

ANCHOR_DISTANCE_MM = 50.0
"""Beyond this far from any feature point the prior shape stands."""
ANCHORS = 60
ROUGHNESS_MM2 = 20.0
"""Variance of the deformation in the kernel's units: with the paper's kernel, two places 10 mm
apart move 0.5 mm differently."""
_EYEBALLS = ("left_eyeball", "right_eyeball")


def deform_head(
    vertices: Float[Array, "v 3"],
    sources: Float[Array, "n 3"],
    targets: Float[Array, "n 3"],
    generic: GenericHead,
    *,
    deviation_mm: Float[Array, " n"] | float = 0.0,
    kernel: str = "exponential",
) -> Float[Array, "v 3"]:
    """All vertices moved smoothly so that the features go from their sources to their targets.

    Far from every feature (the back of the head) the shape stays. Eyeballs stay round: each is
    moved and scaled as a whole.

    Args:
        vertices: (V, 3) mm, the shape so far.
        sources: (N, 3) mm, the features on it.
        targets: (N, 3) mm, where they belong.
        generic: the generic head.
        deviation_mm: how well a target is known; 0 meets it exactly.
        kernel: as in fit_rbf.

    Source:
        [Pighin 2002] sec. 5.1.2, eq. (3); the anchors and the deviations are ours.
    """
    anchors = _far_vertices(vertices, sources, generic)
    centers = np.concatenate([sources, vertices[anchors]])
    moves = np.concatenate([targets - sources, np.zeros((len(anchors), 3))])
    deviation = np.broadcast_to(deviation_mm, len(sources))
    smoothing = np.append(deviation**2, np.zeros(len(anchors))) / ROUGHNESS_MM2
    moved: Array = vertices + fit_rbf(centers, moves, kernel=kernel, smoothing=smoothing)(vertices)
    return with_round_eyes(moved, vertices, generic)


def _far_vertices(
    vertices: Float[Array, "v 3"], sources: Float[Array, "n 3"], generic: GenericHead
) -> Array:
    """Skin vertices far from any feature, spread out (farthest-point order)."""
    skin = generic.mesh.vertices_of("skin")
    far = skin[cKDTree(sources).query(vertices[skin])[0] > ANCHOR_DISTANCE_MM]
    if len(far) == 0:
        return np.zeros(0, np.int64)
    chosen = [int(far[0])]
    distance = np.full(len(far), np.inf)
    for _ in range(min(ANCHORS, len(far)) - 1):
        step = np.linalg.norm(vertices[far] - vertices[chosen[-1]], axis=1)
        distance = np.minimum(distance, step)
        chosen.append(int(far[distance.argmax()]))
    return np.array(chosen)


def with_round_eyes(
    moved: Float[Array, "v 3"], before: Float[Array, "v 3"], generic: GenericHead
) -> Float[Array, "v 3"]:
    """The moved head, each eyeball moved, turned and scaled as a whole."""
    result = moved.copy()
    for name in _EYEBALLS:
        ball = generic.mesh.vertices_of(name)
        result[ball] = estimate_similarity(before[ball], moved[ball])(before[ball])
    return result


def eye_centers(mesh: Mesh) -> Float[Array, "2 3"]:
    """(2, 3) mm: centres of the left and the right eyeball."""
    balls = [mesh.vertices_of(name) for name in _EYEBALLS]
    return np.stack([mesh.vertices[ball].mean(axis=0) for ball in balls])


def vertex_uncertainty(
    vertices: Float[Array, "v 3"],
    points: Float[Array, "n 3"],
    deviation_mm: Float[Array, " n"],
    *,
    prior_mm: float,
    reach_mm: float = 25.0,
) -> Float[Array, " v"]:
    """(V,) mm: near a feature what is known of it, far from all what the prior leaves open.

    Args:
        vertices: (V, 3) mm.
        points: (N, 3) mm, the features.
        deviation_mm: (N,) of the features there.
        prior_mm: deviation of a point without observations.
        reach_mm: how far a feature speaks for its neighbourhood.
    """
    distance, nearest = cKDTree(points).query(vertices)
    share = np.exp(-((distance / reach_mm) ** 2))
    known = np.minimum(deviation_mm[nearest], prior_mm)
    return np.sqrt(share * known**2 + (1 - share) * prior_mm**2)
