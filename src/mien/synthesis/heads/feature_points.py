"""Feature points on the mesh of a head, and how its skin follows them ([Zhang 2006] section 9)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import load_generic_head
from mien.reconstruction.dense.surface import cotangent_laplacian
from mien.rig.followers import part_vertices
from mien.synthesis.heads.skin_interpolation import behind_lips_and_lids, harmonic_extension

__all__ = ["feature_points_on", "thin_plate_weights"]

_REACH_MM = 20.0
"""Far from all points a movement fades over so much."""
_HELD = 1e4
"""Weight (mm^2) of a point's miss against the squared bending of the skin: as good as none."""


def feature_points_on(vertices: Float[Array, "*batch v 3"]) -> Float[Array, "*batch n 3"]:
    """The feature points of heads with the generic one's mesh, mm, head space.

    They are the layout's mixes of the landmarks, wherever those are attached to the mesh; so
    points on the irises turn with the eyes. Of offsets of the vertices, those of the points.
    """
    generic = load_generic_head()
    corners = generic.mesh.triangles[generic.landmark_triangles]
    shares = generic.landmark_barycentrics
    landmarks = np.einsum("...lkc,lk->...lc", np.asarray(vertices)[..., corners, :], shares)
    return load_feature_layout().mixes @ landmarks


@cache
def thin_plate_weights() -> Float[Array, "v n"]:
    """(V, n) by how much each vertex moves with each feature point; eyeballs and teeth do not.

    The skin bends as little as it can; a movement of all points alike is one of the face. What
    lies behind lips and lids, and lashes and hair, go along with the skin next to them: bent as
    little as the skin is, a socket would go on as its lid begins, and out through the cheek.

    Source:
        the thin plate on a mesh, L^T M^-1 L (Botsch and Kobbelt, 2004).
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    generic = load_generic_head()
    mesh, skin = generic.mesh, part_vertices(generic, "skin")
    laplacian, areas = cotangent_laplacian(mesh.vertices, mesh.triangles[mesh.triangles_of("skin")])
    laplacian, areas = laplacian[skin][:, skin], areas[skin]
    bending = laplacian.T @ diags_array(1 / areas) @ laplacian + diags_array(areas / _REACH_MM**4)
    mixes = _mixes_of_vertices()[:, skin]
    factors: Any = splu(csc_array(bending + _HELD * csc_array(mixes.T @ mixes)))
    moved = np.zeros((len(mesh.vertices), len(mixes)))
    moved[skin] = factors.solve(_HELD * mixes.T)
    outside = np.zeros(len(moved), bool)
    outside[skin] = True
    return frozen(harmonic_extension(moved, outside & ~behind_lips_and_lids()))


def _mixes_of_vertices() -> Float[Array, "n v"]:
    """(n, V) each feature point from the vertices."""
    generic = load_generic_head()
    landmarks = np.zeros((len(generic.landmark_triangles), len(generic.mesh.vertices)))
    corners = generic.mesh.triangles[generic.landmark_triangles]
    np.put_along_axis(landmarks, corners, generic.landmark_barycentrics, axis=1)
    return load_feature_layout().mixes @ landmarks
