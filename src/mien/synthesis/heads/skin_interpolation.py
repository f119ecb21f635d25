"""Interpolation over a head's skin: of the motion of feature points, of values known in part."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from mien.arrays import Array, Bool, Float, frozen
from mien.assets.generic import load_generic_head
from mien.reconstruction.dense.surface import cotangent_laplacian
from mien.rig.followers import Followers
from mien.synthesis.heads.feature_points import feature_point_matrix

__all__ = ["behind_lips_and_lids", "harmonic_extension", "thin_plate_weights"]

_REACH_MM = 20.0
"""Far from all points, displacements decay over this length."""
_POINT_WEIGHT = 1e4
"""mm^2, of a point's squared residual against the squared bending: practically interpolation."""
_NEIGHBOURS, _MIN_DISTANCE_MM = 6, 0.3


@cache
def thin_plate_weights() -> Float[Array, "v n"]:
    """(V, n) weight of each feature point's displacement at each vertex; 0 on eyeballs and teeth.

    The skin bends as little as possible; the same displacement of all points moves the whole face.
    What lies behind lips and lids, and lashes and hair, take the weights of the skin next to them:
    bending energy alone would continue the slope of a lid, and push a socket through the cheek.

    Source:
        the thin plate on a mesh, L^T M^-1 L (Botsch and Kobbelt, 2004).
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    generic = load_generic_head()
    mesh, skin = generic.mesh, generic.mesh.vertices_of("skin")
    laplacian, areas = cotangent_laplacian(mesh.vertices, mesh.triangles[mesh.triangles_of("skin")])
    laplacian, areas = laplacian[skin][:, skin], areas[skin]
    bending = laplacian.T @ diags_array(1 / areas) @ laplacian + diags_array(areas / _REACH_MM**4)
    points = feature_point_matrix()[:, skin]
    factors: Any = splu(csc_array(bending + _POINT_WEIGHT * csc_array(points.T @ points)))
    weights = np.zeros((len(mesh.vertices), len(points)))
    weights[skin] = factors.solve(_POINT_WEIGHT * points.T)
    is_skin = np.zeros(len(weights), bool)
    is_skin[skin] = True
    return frozen(harmonic_extension(weights, is_skin & ~behind_lips_and_lids()))


def behind_lips_and_lids() -> Bool[Array, " v"]:
    """(V,) whether a vertex lies in the mouth cavity or in an eye socket."""
    regions = load_generic_head().regions
    return np.maximum(regions["mouth_cavity"], regions["eye_socket"]) >= 0.5


def harmonic_extension(
    values: Float[Array, "v k"], known: Bool[Array, " v"]
) -> Float[Array, "v k"]:
    """Values of unknown skin as the mean of its neighbours'; lashes and hair follow the skin.

    Eye sockets take the values of the nearest visible skin: from the lids, to which alone they are
    connected, they would be pushed through the cheeks.

    Args:
        values: (V, K) of the generic head's vertices.
        known: (V,) the skin vertices whose values are kept.

    Returns:
        (V, K), within the range of the known values; parts that are no skin keep theirs.
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import splu

    generic = load_generic_head()
    skin, count = generic.mesh.vertices_of("skin"), len(generic.mesh.vertices)
    triangles = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
    edges = np.vstack([triangles[:, [a, b]] for a in range(3) for b in range(3) if a != b])
    edges = np.unique(edges, axis=0)
    adjacency = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    laplacian = (diags_array(adjacency.sum(axis=1)) - adjacency).tocsr()
    unknown = np.setdiff1d(skin, np.flatnonzero(known))
    extended = np.array(values, np.float64)
    boundary = laplacian[unknown][:, np.flatnonzero(known)] @ extended[known]
    extended[unknown] = splu(laplacian[unknown][:, unknown].tocsc()).solve(-boundary)
    _fill_eye_sockets(extended)
    followers = Followers.of(generic)
    extended[followers.vertices] = followers.carried(extended)
    return extended


def _fill_eye_sockets(values: Float[Array, "v k"]) -> None:
    """In place, from the nearest visible skin by inverse squared distance."""
    from scipy.spatial import cKDTree

    generic = load_generic_head()
    vertices, skin = generic.mesh.vertices, generic.mesh.vertices_of("skin")
    sockets = skin[generic.regions["eye_socket"][skin] >= 0.5]
    visible = skin[~behind_lips_and_lids()[skin]]
    distance, nearest = cKDTree(vertices[visible]).query(vertices[sockets], k=_NEIGHBOURS)
    weights = 1 / np.maximum(distance, _MIN_DISTANCE_MM) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    values[sockets] = np.einsum("sn,snk->sk", weights, values[visible[nearest]])
