"""The skin moved smoothly to where photos show it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.mesh import Mesh
from mien.reconstruction.dense.surface import cotangent_laplacian
from mien.reconstruction.observations import SurfaceObservations, reproject

BENDING = 12.0
"""How stiff skin is: weight (mm^2) of its squared mean bending against squared distances over their
variance."""
REACH_MM = 25.0
"""Distance over which a movement fades away from all observations."""
HELD_SD_MM = 0.3
"""How far skin moves where it is held."""
_ROUNDS = 3


def deform_skin(
    vertices: Float[Array, "v 3"],
    observations: SurfaceObservations,
    cameras: Sequence[Camera],
    generic: GenericHead,
    *,
    held: Float[Array, " v"],
    across_sd_mm: float | None = None,
) -> Float[Array, "v 3"]:
    """The head with its skin where the photos show it; what one photo leaves open stays.

    Minimizes the Cauchy-weighted squared reprojection errors plus BENDING * bending(d) over
    the movements d of all skin, the mouth's inside included, which goes along over the lips.

    Args:
        vertices: (V, 3) mm, the head so far.
        observations: of the skin.
        cameras: of the photos.
        generic: the generic head.
        held: (V,) in [0, 1]: where skin is to stay.
        across_sd_mm: how far the skin may move along its normals; None leaves it free.
    """
    mesh = generic.mesh.with_vertices(vertices)
    skin = mesh.vertices_of("skin")
    number = np.full(len(vertices), -1)
    number[skin] = np.arange(len(skin))
    stiffness = _stiffness(mesh, skin, held, across_sd_mm)
    moves = np.zeros(3 * len(skin))
    for _ in range(_ROUNDS):
        moved = vertices.copy()
        moved[skin] += moves.reshape(-1, 3)
        matrix, pull = _normal_equations(moved, observations, cameras, number)
        moves = moves + _solve((matrix + stiffness).tocsc(), pull - stiffness @ moves)
    result = vertices.copy()
    result[skin] += moves.reshape(-1, 3)
    return result


def _solve(matrix: Any, right: Float[Array, " n"]) -> Float[Array, " n"]:
    """SuperLU's way with symmetric positive definite matrices: half the time and memory."""
    from scipy.sparse.linalg import splu

    symmetric = {"SymmetricMode": True}
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    return factors.solve(right)


def _normal_equations(
    vertices: Float[Array, "v 3"],
    observations: SurfaceObservations,
    cameras: Sequence[Camera],
    number: Int[Array, " v"],
) -> tuple[Any, Array]:
    """J^T W J and -J^T W r over the skin's movements."""
    from scipy.sparse import csr_array, diags_array

    errors = reproject(observations, observations.on(vertices) + observations.offset, cameras)
    used: Bool[Array, " m"] = np.asarray((number[observations.corners] >= 0).all(axis=1))
    count = len(used)
    # Two rows an observation; in each its point's three corners, each with three movements.
    by_place = errors.projection.point_jacobian
    values = observations.barycentrics[:, None, :, None] * by_place[:, :, None, :]
    columns = 3 * np.maximum(number[observations.corners], 0)[:, None, :, None] + np.arange(3)
    rows = np.arange(2 * count).reshape(-1, 2)[:, :, None, None]
    rows, columns = (np.broadcast_to(index, values.shape).ravel() for index in (rows, columns))
    shape = (2 * count, 3 * int(number.max() + 1))
    jacobian = csr_array((values.ravel(), (rows, columns)), shape=shape)
    weighted = diags_array(np.repeat(np.where(used, errors.weights, 0.0), 2)) @ jacobian
    return jacobian.T @ weighted, -(weighted.T @ errors.residuals.ravel())


def _stiffness(
    mesh: Mesh, skin: Int[Array, " s"], held: Float[Array, " v"], across_sd_mm: float | None
) -> Any:
    """(3S, 3S) sparse: bending of the skin, and the springs that let a movement fade.

    Source:
        the thin plate on a mesh, L^T M^-1 L (Botsch and Kobbelt, 2004).
    """
    from scipy.sparse import bsr_array, diags_array, eye_array, kron

    laplacian, areas = cotangent_laplacian(mesh.vertices, mesh.triangles[mesh.triangles_of("skin")])
    laplacian, areas = laplacian[skin][:, skin], areas[skin]
    spring = BENDING * areas / REACH_MM**4 + areas * held[skin] ** 2 / HELD_SD_MM**2
    bending = BENDING * laplacian.T @ diags_array(1 / areas) @ laplacian + diags_array(spring)
    stiffness = kron(bending, eye_array(3), format="csr")
    if across_sd_mm is None:
        return stiffness
    normals = mesh.vertex_normals()[skin]
    across = normals[:, :, None] * normals[:, None, :] * areas[:, None, None] / across_sd_mm**2
    return stiffness + bsr_array((across, np.arange(len(skin)), np.arange(len(skin) + 1))).tocsr()
