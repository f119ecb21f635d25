"""How far a fitted head is from a scan of the same person (docs/accuracy.md tells how and why)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from mien.arrays import Array, Float, Int
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.raster import rasterize

FACE_RADIUS_MM = 12.0
TRIM = 0.05


@dataclass(frozen=True)
class Scan:
    """A scanned surface and the true cameras of the photos taken with it, in one frame, mm."""

    surface: trimesh.Trimesh
    cameras: dict[str, Camera]


@dataclass(frozen=True)
class SurfaceError:
    """Distances in mm from samples of a head's face to the scan, after alignment."""

    median: float
    mean: float
    p95: float

    def __str__(self) -> str:
        return f"{self.median:.2f} / {self.mean:.2f} / {self.p95:.2f}"


def load_scan(folder: Path) -> Scan:
    """The scan and cameras of a folder of development data (`james` or `emily`)."""
    entries = json.loads((folder / "cameras_opencv.json").read_text())
    unit = 1.0 if folder.name == "james" else 10.0
    cameras = {
        name: _camera(entry, unit)
        for name, entry in entries.items()
        if name[0] != "_" and "K" in entry
    }
    if folder.name == "james":
        surface = trimesh.load_mesh(folder / "james.obj", process=False)
    else:
        surface = trimesh.load_mesh(folder / "geometry" / "Emily_head_mesh.ply", process=False)
        surface.apply_transform(np.array(entries["object_to_world"]))
        surface.apply_scale(unit)
    return Scan(surface, cameras)


@dataclass(frozen=True)
class Samples:
    """Points fixed to a mesh, so that the same places are compared on every head."""

    triangles: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]

    def on(self, vertices: Float[Array, "v 3"]) -> Float[Array, "n 3"]:
        """(N, 3) where the samples lie on a head with these vertices."""
        places: Array = np.einsum("nc,ncd->nd", self.barycentrics, vertices[self.triangles])
        return places


def face_samples(mesh: Mesh, cameras: list[Camera], near: Float[Array, "n 3"]) -> Samples:
    """What the head's own cameras see of it, within 12 mm of a landmark's attachment.

    Args:
        mesh: the fitted head.
        cameras: its cameras; every fourth pixel of a small raster is taken.
        near: (N, 3) mm, the landmarks' attachments on the same head.
    """
    tree = cKDTree(near)
    triangles, barycentrics = [], []
    for camera in (camera.resized(500 / camera.height) for camera in cameras):
        in_camera = camera.to_camera(mesh.vertices)
        raster = rasterize(
            camera.project(mesh.vertices),
            in_camera[:, 2],
            mesh.triangles,
            camera.width,
            camera.height,
        )
        hit = raster.triangle_ids >= 0
        corners = mesh.triangles[raster.triangle_ids[hit]]
        samples = Samples(corners, np.asarray(raster.barycentrics[hit], np.float64))
        close = tree.query(samples.on(mesh.vertices))[0] < FACE_RADIUS_MM
        triangles.append(samples.triangles[close][::2])
        barycentrics.append(samples.barycentrics[close][::2])
    return Samples(np.concatenate(triangles), np.concatenate(barycentrics))


def start_from_shared_pixels(
    scan: Scan, mesh: Mesh, camera: Camera, true_camera: Camera
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Points of the head and of the scan that are seen through the same pixels of one photo."""
    factor = 250 / camera.height
    clouds = []
    surfaces = (
        (mesh.vertices, mesh.triangles, camera.resized(factor)),
        (
            np.asarray(scan.surface.vertices),
            np.asarray(scan.surface.faces, np.int32),
            true_camera.resized(factor),
        ),
    )
    for vertices, triangles, small in surfaces:
        depth = small.to_camera(vertices)[:, 2]
        raster = rasterize(small.project(vertices), depth, triangles, small.width, small.height)
        rows, columns = np.mgrid[: small.height, : small.width] + 0.5
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        seen = raster.triangle_ids.ravel() >= 0
        flat = np.where(seen, raster.depth.ravel(), 1.0).astype(np.float64)
        clouds.append((small.unproject(pixels, flat), seen))
    both = clouds[0][1] & clouds[1][1]
    return clouds[0][0][both], clouds[1][0][both]


def similarity(source: Float[Array, "n 3"], target: Float[Array, "n 3"]) -> Float[Array, "4 4"]:
    """The similarity that takes source nearest to target in the least-squares sense (Umeyama)."""
    a, b = source - source.mean(0), target - target.mean(0)
    U, S, Vt = np.linalg.svd(b.T @ a)
    flip = np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))])
    R = U @ flip @ Vt
    scale = (S * np.diag(flip)).sum() / (a * a).sum()
    T = np.eye(4)
    T[:3, :3] = scale * R
    T[:3, 3] = target.mean(0) - scale * R @ source.mean(0)
    return T


def move(T: Float[Array, "4 4"], points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """Points under a 4x4 transform."""
    moved: Array = points @ T[:3, :3].T + T[:3, 3]
    return moved


def distance_to(
    scan: Scan, points: Float[Array, "n 3"], start: Float[Array, "4 4"]
) -> SurfaceError:
    """ICP by a similarity (the worst 5 % dropped while aligning, none while reporting)."""
    nearest = _NearestPoint(scan.surface)
    T = start
    for _ in range(200):
        moved = move(T, points)
        closest, distances = nearest(moved)
        keep = distances <= np.quantile(distances, 1 - TRIM)
        step = similarity(moved[keep], closest[keep])
        T = step @ T
        if np.abs(step - np.eye(4)).max() < 1e-5:
            break
    distances = nearest(move(T, points))[1]
    return SurfaceError(
        float(np.median(distances)), float(distances.mean()), float(np.quantile(distances, 0.95))
    )


class _NearestPoint:
    """Nearest points on a triangle mesh: exact among the triangles near the nearest samples."""

    def __init__(self, surface: trimesh.Trimesh) -> None:
        samples, self._faces = trimesh.sample.sample_surface_even(surface, 60_000, seed=0)
        self._tree = cKDTree(samples)
        self._triangles = np.asarray(surface.triangles)

    def __call__(self, points: Float[Array, "n 3"]) -> tuple[Array, Array]:
        candidates = self._faces[self._tree.query(points, k=3)[1]]
        best = np.full(len(points), np.inf)
        closest = np.zeros_like(points)
        for column in candidates.T:
            on_triangle = trimesh.triangles.closest_point(self._triangles[column], points)
            distance = np.linalg.norm(on_triangle - points, axis=1)
            nearer = distance < best
            best[nearer], closest[nearer] = distance[nearer], on_triangle[nearer]
        return closest, best


def relative_rotation_error(cameras: dict[str, Camera], scan: Scan) -> list[float]:
    """Degrees between the true and the fitted rotation from the first photo to each other one."""
    names = sorted(set(cameras) & set(scan.cameras))
    errors = []
    for name in names[1:]:
        fitted = cameras[name].R_cam_head @ cameras[names[0]].R_cam_head.T
        true = scan.cameras[name].R_cam_head @ scan.cameras[names[0]].R_cam_head.T
        cosine = (np.trace(fitted @ true.T) - 1) / 2
        errors.append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    return errors


def _camera(entry: dict, unit: float) -> Camera:
    K = np.array(entry["K"])
    U, _, Vt = np.linalg.svd(np.array(entry["R"]))
    return Camera(
        entry["width"],
        entry["height"],
        float(K[0, 0] + K[1, 1]) / 2,
        U @ Vt,
        np.array(entry["t"]) * unit,
        K[:2, 2],
    )
