"""Feature points on the mesh of a head ([Zhang 2006] section 9)."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import load_generic_head

__all__ = ["feature_point_matrix", "feature_points_on"]


def feature_points_on(vertices: Float[Array, "*batch v 3"]) -> Float[Array, "*batch n 3"]:
    """The feature points of heads with the generic one's mesh.

    They are the layout's combinations of the landmarks, wherever those are attached to the mesh; so
    points on the irises turn with the eyes.

    Args:
        vertices: (..., V, 3) mm, head space; or offsets, mm.

    Returns:
        (..., n, 3) mm, head space; of offsets of the vertices, those of the points.
    """
    generic = load_generic_head()
    corners = generic.mesh.triangles[generic.landmark_triangles]
    weights = generic.landmark_barycentrics
    landmarks = np.einsum("...lkc,lk->...lc", np.asarray(vertices)[..., corners, :], weights)
    return load_feature_layout().landmark_weights @ landmarks


def feature_point_matrix() -> Float[Array, "n v"]:
    """(n, V) the linear map of `feature_points_on`, for one coordinate."""
    generic = load_generic_head()
    landmarks = np.zeros((len(generic.landmark_triangles), len(generic.mesh.vertices)))
    corners = generic.mesh.triangles[generic.landmark_triangles]
    np.put_along_axis(landmarks, corners, generic.landmark_barycentrics, axis=1)
    return load_feature_layout().landmark_weights @ landmarks
