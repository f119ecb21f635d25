"""Distances to the same surface point, where nearest points would flatter, and honest bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.scan import (
    FACE_RADIUS_MM,
    TRIM,
    Scan,
    SurfaceError,
    move,
    similarity,
    start_from_shared_pixels,
)
from mien.arrays import Array, Bool, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.mesh import Mesh
from mien.render.shade import rasterize_mesh, shown_parts

_ROUNDS = 20


@dataclass(frozen=True)
class Calibration:
    """Shares of vertices that lie within two of their uncertainties from the truth.

    Attributes:
        face: of those of the face that a photo shows.
        skin: of all skin vertices.
    """

    face: float
    skin: float


def behind_pixels(
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
    cameras: Mapping[str, Camera],
    scan: Scan,
) -> SurfaceError:
    """Distances between what the head and the scan show behind the same pixels of all photos.

    Every photo's face counts (within 12 mm of a landmark's attachment), after one similarity; the
    farthest 5 % do not pull.
    """
    mesh = generic.mesh.with_vertices(vertices)
    near = cKDTree(generic.landmark_positions(vertices)[generic.landmark_attached])
    pairs = [
        start_from_shared_pixels(scan, mesh, camera, scan.cameras[name])
        for name, camera in cameras.items()
    ]
    on_head, on_scan = (np.concatenate(side) for side in zip(*pairs, strict=True))
    face = near.query(on_head)[0] < FACE_RADIUS_MM
    return _after_similarity(on_head[face], on_scan[face])


def same_vertices(
    vertices: Float[Array, "v 3"], truth: Float[Array, "v 3"], chosen: Bool[Array, " v"]
) -> SurfaceError:
    """Distances between the chosen vertices of a head and of the true one, after a similarity."""
    return _after_similarity(vertices[chosen], truth[chosen])


def calibration(
    vertices: Float[Array, "v 3"],
    uncertainty_mm: Float[Array, " v"],
    truth: Float[Array, "v 3"],
    face: Bool[Array, " v"],
    generic: GenericHead,
) -> Calibration:
    """How often the head's own bounds hold; the similarity is the one of the seen face."""
    T = _trimmed_similarity(vertices[face], truth[face])
    # The fit's millimetres are those of its own scale.
    scale = float(np.cbrt(np.linalg.det(T[:3, :3])))
    error = np.linalg.norm(move(T, vertices) - truth, axis=1)
    held = error <= 2 * scale * uncertainty_mm
    return Calibration(float(held[face].mean()), float(held[_skin(generic.mesh)].mean()))


def seen_face(
    truth: Float[Array, "v 3"], generic: GenericHead, cameras: Mapping[str, Camera]
) -> Bool[Array, " v"]:
    """(V,) skin vertices of the face that at least one of the true cameras sees."""
    mesh = generic.mesh.with_vertices(truth)
    shown = mesh.submesh(mesh.triangles_of(*shown_parts(mesh)))
    attached = generic.landmark_positions(truth)[generic.landmark_attached]
    close: Array = cKDTree(attached).query(truth)[0] < FACE_RADIUS_MM
    return _seen(shown, cameras) & _skin(mesh) & close


def _seen(mesh: Mesh, cameras: Mapping[str, Camera]) -> Bool[Array, " v"]:
    """(V,) corners of the triangles that some pixel shows."""
    seen = np.zeros(len(mesh.vertices), bool)
    for camera in cameras.values():
        raster = rasterize_mesh(mesh, camera)
        seen[mesh.triangles[np.unique(raster.triangle_ids[raster.mask])]] = True
    return seen


def _skin(mesh: Mesh) -> Bool[Array, " v"]:
    inside = np.zeros(len(mesh.vertices), bool)
    inside[mesh.triangles[mesh.triangles_of("skin")]] = True
    return inside


def _after_similarity(source: Float[Array, "n 3"], target: Float[Array, "n 3"]) -> SurfaceError:
    T = _trimmed_similarity(source, target)
    return SurfaceError.of(np.linalg.norm(move(T, source) - target, axis=1))


def _trimmed_similarity(
    source: Float[Array, "n 3"], target: Float[Array, "n 3"]
) -> Float[Array, "4 4"]:
    """The similarity that takes source nearest to target, the farthest 5 % left out."""
    T = similarity(source, target)
    for _ in range(_ROUNDS):
        distances = np.linalg.norm(move(T, source) - target, axis=1)
        keep = distances <= np.quantile(distances, 1 - TRIM)
        T = similarity(source[keep], target[keep])
    return T
