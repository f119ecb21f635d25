"""What is known of some of a head's skin, carried over to the rest of it."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.assets.generic import load_generic_head
from mien.rig.followers import Followers, part_vertices

__all__ = ["behind_lips_and_lids", "harmonic_extension"]

_NEIGHBOURS, _LEAST_MM = 6, 0.3


def behind_lips_and_lids() -> Bool[Array, " v"]:
    """(V,) what lies behind the lips and the lids."""
    regions = load_generic_head().regions
    return np.maximum(regions["mouth_cavity"], regions["eye_socket"]) >= 0.5


def harmonic_extension(
    values: Float[Array, "v k"], known: Bool[Array, " v"]
) -> Float[Array, "v k"]:
    """Where nothing is known, skin is the mean of its neighbours; lashes and hair follow the skin.

    Eye sockets have what the skin before them has: what they share with the lids alone would take
    them through the cheeks.

    Args:
        values: (V, K) of the generic head's vertices.
        known: (V,) the skin vertices whose values hold.

    Returns:
        (V, K), nowhere beyond the values that are known; what is neither is as it was.
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import splu

    generic = load_generic_head()
    skin, count = part_vertices(generic, "skin"), len(generic.mesh.vertices)
    triangles = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
    ends = np.vstack([triangles[:, [a, b]] for a in range(3) for b in range(3) if a != b])
    ends = np.unique(ends, axis=0)
    joined = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    apart = (diags_array(joined.sum(axis=1)) - joined).tocsr()
    unknown = np.setdiff1d(skin, np.flatnonzero(known))
    spread = np.array(values, np.float64)
    towards = apart[unknown][:, np.flatnonzero(known)] @ spread[known]
    spread[unknown] = splu(apart[unknown][:, unknown].tocsc()).solve(-towards)
    _set_sockets(spread)
    followers = Followers.of(generic)
    spread[followers.vertices] = followers.carried(spread)
    return spread


def _set_sockets(values: Float[Array, "v k"]) -> None:
    """In place, by the nearest skin that is seen."""
    from scipy.spatial import cKDTree

    generic = load_generic_head()
    places, skin = generic.mesh.vertices, part_vertices(generic, "skin")
    sockets = skin[generic.regions["eye_socket"][skin] >= 0.5]
    before = skin[~behind_lips_and_lids()[skin]]
    distance, nearest = cKDTree(places[before]).query(places[sockets], k=_NEIGHBOURS)
    weights = 1 / np.maximum(distance, _LEAST_MM) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    values[sockets] = np.einsum("sn,snk->sk", weights, values[before[nearest]])
