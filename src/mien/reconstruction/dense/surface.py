"""Surface detail that the smooth modes leave out: an offset of each vertex along its normal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Bool, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.segment_sum import SegmentSum
from mien.reconstruction.bundle.projection import PinholeArrays, project_points
from mien.reconstruction.dense.joint import noise_variance
from mien.reconstruction.dense.tracks import Tracks
from mien.reconstruction.shape.deformation import with_round_eyes

BENDING = 3.0
"""How stiff the surface is: weight (mm^2) of its squared mean bending against squared offsets over
their variance."""
MIN_SD_MM = 0.05
"""No point is known better than this, however many photos agree."""
_WRONG_SDS = 1.5
_ROUNDS = 4
_REACH_MM = 30.0
_STRAIGHTENED_MM, _MIN_STRAIGHTNESS = 6.0, 0.3
"""How far around normals are averaged into directions of movement, and the least cosine between the
two that counts."""
_FAR_MM = 10.0
"""A point may lie this far off the surface along the rays."""


@dataclass(frozen=True)
class Offsets:
    """How far the photos put N points off the surface.

    Attributes:
        along_normal: (N,) mm.
        sd: (N,) mm, by the errors of the image points alone.
    """

    along_normal: Float[Array, " n"]
    sd: Float[Array, " n"]


NO_OFFSETS = Offsets(np.zeros(0), np.zeros(0))


def measure_offsets(
    tracks: Tracks, cameras: Sequence[Camera], mesh: Mesh, *, rounds: int = 4
) -> Offsets:
    """Places where their rays meet, cameras fixed, as offsets along the surface's normals."""
    start = tracks.on(mesh.vertices)
    normals = tracks.on(mesh.vertex_normals())
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pinholes, sum_by_point = PinholeArrays.of(cameras), SegmentSum(tracks.point, len(start))
    principal = np.stack([camera.principal for camera in cameras])
    image = tracks.image_points - principal[tracks.photo]
    weak = np.eye(3) / _FAR_MM**2
    points = start
    for _ in range(rounds):
        projection = project_points(pinholes, tracks.photo, points[tracks.point])
        residuals = projection.image_points - image
        squared = (residuals**2).sum(axis=1) / tracks.sigma_px**2
        weights = 1 / (tracks.sigma_px**2 * (1 + squared / 4))
        weighted = np.swapaxes(weights[:, None, None] * projection.point_jacobian, 1, 2)
        covariance = np.linalg.inv(weak + sum_by_point(weighted @ projection.point_jacobian))
        gradient = sum_by_point((weighted @ residuals[..., None])[..., 0]) + (points - start) @ weak
        points = points - (covariance @ gradient[..., None])[..., 0]
    offsets: Array = ((points - start) * normals).sum(axis=1)
    sd = np.sqrt(np.einsum("ni,nij,nj->n", normals, covariance, normals))
    # Places that share a patch of the matching share its error.
    sd *= np.sqrt(noise_variance(np.sqrt(squared), len(start)) * tracks.overlap)
    return Offsets(offsets, np.maximum(sd, MIN_SD_MM))


def move_surface(
    vertices: Float[Array, "v 3"], tracks: Tracks, offsets: Offsets, generic: GenericHead
) -> Float[Array, "v 3"]:
    """The head moved to where the photos put it, smoothly.

    Minimizes sum_n rho((b_n . h - offset_n) / sd_n) + BENDING * bending(h) over the heights h of
    the outer skin's vertices. Without observations h continues smoothly and fades. A height is
    along the normal, averaged so far around that the two lips, or the two lids, move the same way
    and do not part. What lies inside (mouth, eye sockets) goes with the skin near it; eyeballs
    stay round.
    """
    surface = _height_problem(generic)
    mesh = generic.mesh.with_vertices(vertices)
    directions = _directions(mesh, surface.outer)
    heights = _solve_heights(surface, tracks, offsets, mesh, directions)
    moves = heights[:, None] * directions
    moved = vertices + _carried(moves, vertices, surface.outer)
    return with_round_eyes(moved, vertices, generic)


def sample_heights(
    tracks: Tracks, offsets: Offsets, generic: GenericHead, *, draws: int, seed: int = 0
) -> Float[Array, "d v"]:
    """(D, V) mm: draws of what the offsets leave open of the skin's heights.

    Source:
        perturb and solve (Papandreou and Yuille, 2010): with data and stiffness perturbed by

    their own noise, the solutions scatter as the posterior does.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    surface = _height_problem(generic)
    spread, used = surface.at(tracks)
    weights = used / offsets.sd**2
    matrix = (spread.T @ diags_array(weights) @ spread + surface.stiffness).tocsc()
    rng = np.random.default_rng(seed)
    count = len(weights)
    data = spread.T @ (np.sqrt(weights)[:, None] * rng.normal(size=(count, draws)))
    bending = surface.root.T @ rng.normal(size=(surface.root.shape[0], draws))
    return splu(matrix).solve(np.asarray(data + bending)).T


def _solve_heights(
    surface: _HeightProblem,
    tracks: Tracks,
    offsets: Offsets,
    mesh: Mesh,
    directions: Float[Array, "v 3"],
) -> Float[Array, " v"]:
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    spread, used = surface.at(tracks)
    # Offsets are along the normals, heights along smoother directions.
    normals = mesh.vertex_normals()
    straightness = (tracks.on(normals) * tracks.on(directions)).sum(axis=1)
    spread = diags_array(np.maximum(straightness, _MIN_STRAIGHTNESS)) @ spread
    heights, left = np.zeros(spread.shape[1]), offsets.along_normal
    for _ in range(_ROUNDS):
        weights = used / (offsets.sd**2 * (1 + (left / (_WRONG_SDS * offsets.sd)) ** 2))
        matrix = (spread.T @ diags_array(weights) @ spread + surface.stiffness).tocsc()
        heights = splu(matrix).solve(spread.T @ (weights * offsets.along_normal))
        left = offsets.along_normal - spread @ heights
    return heights


def _carried(
    moves: Float[Array, "v 3"], vertices: Float[Array, "v 3"], outer: Bool[Array, " v"]
) -> Float[Array, "v 3"]:
    """Vertices that are not outer skin go with the outer skin around them."""
    distance, nearest = cKDTree(vertices[outer]).query(vertices[~outer], k=24)
    weights = np.exp(-((distance / (distance[:, :1] + 5.0)) ** 2))
    result = moves.copy()
    near = moves[outer][nearest]
    result[~outer] = (weights[..., None] * near).sum(axis=1) / weights.sum(axis=1)[:, None]
    return result


def _directions(mesh: Mesh, outer: Bool[Array, " v"]) -> Float[Array, "v 3"]:
    """(V, 3) unit: the outer skin's normals, averaged over their surroundings."""
    used = outer[mesh.triangles].all(axis=1)
    normals = mesh.submesh(np.flatnonzero(used)).vertex_normals()
    distance, nearest = cKDTree(mesh.vertices[outer]).query(mesh.vertices[outer], k=48)
    weights = np.exp(-((distance / _STRAIGHTENED_MM) ** 2))
    averaged = (weights[..., None] * normals[outer][nearest]).sum(axis=1)
    directions = np.zeros_like(normals)
    length = np.linalg.norm(averaged, axis=1, keepdims=True)
    directions[outer] = averaged / np.maximum(length, 1e-9)
    return directions


@dataclass(frozen=True)
class _HeightProblem:
    """What does not depend on the photos.

    Attributes:
        outer: (V,) which vertices are skin that shows; the others have no height.
        stiffness: (V, V) sparse, root^T root.
        root: (R, V).
    """

    outer: Bool[Array, " v"]
    stiffness: Any
    root: Any

    def at(self, tracks: Tracks) -> tuple[Any, Bool[Array, " n"]]:
        """(N, V) sparse: heights of the vertices to heights at the points; which have one."""
        from scipy.sparse import csr_array

        count = len(tracks.corners)
        rows = np.repeat(np.arange(count), 3)
        spread = csr_array(
            (tracks.barycentrics.ravel(), (rows, tracks.corners.ravel())),
            shape=(count, len(self.outer)),
        )
        used: Array = np.asarray(self.outer[tracks.corners].all(axis=1))
        return spread, used


def _height_problem(generic: GenericHead) -> _HeightProblem:
    """Bending of a height field on the skin, and a spring that lets it fade far from all data.

    Source:
        the thin plate on a mesh, L^T M^-1 L with cotangent Laplacian L and areas M

    (Botsch and Kobbelt, 2004).
    """
    from scipy.sparse import csr_array, diags_array, vstack

    vertices = generic.mesh.vertices
    skin = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
    inner = np.maximum(generic.regions["mouth_cavity"], generic.regions["eye_socket"]) > 0.5
    triangles = skin[~inner[skin].any(axis=1)]
    outer = np.zeros(len(vertices), bool)
    outer[triangles] = True
    laplacian, areas = cotangent_laplacian(vertices, triangles)
    spring = np.where(outer, np.sqrt(BENDING * areas) / _REACH_MM**2, 1.0)
    root = csr_array(
        vstack(
            [np.sqrt(BENDING) * diags_array(1 / np.sqrt(areas)) @ laplacian, diags_array(spring)]
        )
    )
    return _HeightProblem(outer, csr_array(root.T @ root), root)


def cotangent_laplacian(vertices: Array, triangles: Array) -> tuple[Any, Array]:
    """Cotangent Laplacian (V, V) and each vertex's area, mm^2."""
    from scipy.sparse import csr_array, diags_array

    count = len(vertices)
    rows, columns, values = [], [], []
    areas = np.zeros(count)
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        u = vertices[triangles[:, b]] - vertices[triangles[:, a]]
        v = vertices[triangles[:, c]] - vertices[triangles[:, a]]
        twice_area = np.linalg.norm(np.cross(u, v), axis=1)
        # Slivers have cotangents without bound.
        cotangent = np.clip((u * v).sum(axis=1) / np.maximum(twice_area, 1e-9), 0.02, 5.0) / 2
        rows += [triangles[:, b], triangles[:, c]]
        columns += [triangles[:, c], triangles[:, b]]
        values += [cotangent, cotangent]
        np.add.at(areas, triangles[:, a], twice_area / 6)
    weights = csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        shape=(count, count),
    )
    degree = diags_array(weights.sum(axis=1))
    return degree - weights, np.maximum(areas, 1e-3)
