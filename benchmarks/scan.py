"""How far a fitted head is from a scan of the same person.

docs/notes/accuracy.md says how and why.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.nearest import NearestPoint
from mien.arrays import Array, Float, Int
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.rotation import angle_between
from mien.numeric.similarity import estimate_similarity
from mien.render.shade import rasterize_mesh, shown_parts

DATA = Path(__file__).parents[2] / "shared" / "data"
FACE_RADIUS_MM = 12.0
"""A face reaches this far around the landmarks' attachments."""
TRIM = 0.05
"""Share of the samples, the worst, that does not count while aligning; it does when reporting."""
ALIGNING = 3000
"""How many samples take part in the alignment."""
_SURFACES = (".obj", ".ply")


@dataclass(frozen=True)
class Scan:
    """A scanned surface and the true cameras of the photos taken with it, in one frame, mm."""

    surface: trimesh.Trimesh
    cameras: dict[str, Camera]

    @cached_property
    def nearest(self) -> NearestPoint:
        """Finds nearest points of the surface."""
        return NearestPoint(self.surface)


@dataclass(frozen=True)
class SurfaceError:
    """Distances in mm from samples of a head's face to the nearest points of the scan."""

    median: float
    mean: float
    p95: float

    @classmethod
    def of(cls, distances: Float[Array, " n"]) -> SurfaceError:
        """Summary of (N,) distances."""
        p95 = np.quantile(distances, 0.95)
        return cls(float(np.median(distances)), float(distances.mean()), float(p95))

    def __str__(self) -> str:
        return f"{self.median:.2f} / {self.mean:.2f} / {self.p95:.2f}"


@dataclass(frozen=True)
class Comparison:
    """A head laid on a scan.

    Attributes:
        before: errors where points that share a pixel put the head.
        after: errors after ICP.
        T_scan_head: (4, 4) the similarity that ICP ended with.
    """

    before: SurfaceError
    after: SurfaceError
    T_scan_head: Float[Array, "4 4"]

    def __str__(self) -> str:
        return str(self.after)


@dataclass(frozen=True)
class Samples:
    """Points fixed to a mesh, so that the same places are compared on every head.

    Attributes:
        triangles: (N, 3) vertices of the triangle that holds each.
        barycentrics: (N, 3) in it.
    """

    triangles: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]

    def on(self, vertices: Float[Array, "v 3"]) -> Float[Array, "n 3"]:
        """(N, 3) where the samples lie on a head with these vertices."""
        return np.einsum("nc,ncd->nd", self.barycentrics, vertices[self.triangles])


def load_scan(folder: Path) -> Scan:
    """The scan and cameras of a folder: `cameras_opencv.json` and one .obj or .ply in mm.

    Also reads the development data of Emily, which are in cm and in a frame of their own.
    """
    entries = json.loads((folder / "cameras_opencv.json").read_text(encoding="utf-8"))
    if "object_to_world" in entries:
        unit, path = 10.0, folder / "geometry" / "Emily_head_mesh.ply"
        surface = trimesh.load_mesh(path, process=False)
        surface.apply_transform(np.array(entries["object_to_world"]))
        surface.apply_scale(unit)
    else:
        unit, path = 1.0, next(p for p in sorted(folder.iterdir()) if p.suffix in _SURFACES)
        surface = trimesh.load_mesh(path, process=False)
    cameras = {
        name: _camera(entry, unit)
        for name, entry in entries.items()
        if isinstance(entry, dict) and "K" in entry
    }
    return Scan(surface, cameras)


def save_scan(folder: Path, mesh: Mesh, cameras: Mapping[str, Camera]) -> None:
    """Writes `scan.ply` (mm) and `cameras_opencv.json` for load_scan; cameras by photo stem."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    surface.export(folder / "scan.ply")
    entries = {name: _entry(camera) for name, camera in cameras.items()}
    text = json.dumps(entries, indent=1)
    (folder / "cameras_opencv.json").write_text(text + "\n", encoding="utf-8")


def scan_mesh(scan: Scan) -> Mesh:
    """The scan's surface as a mesh."""
    return Mesh(np.array(scan.surface.vertices), np.array(scan.surface.faces, np.int32))


def _entry(camera: Camera) -> dict[str, object]:
    x, y = camera.principal.tolist()
    return {
        "width": camera.width,
        "height": camera.height,
        "K": [[camera.focal_px, 0.0, x], [0.0, camera.focal_px, y], [0.0, 0.0, 1.0]],
        "R": camera.R_cam_head.tolist(),
        "t": camera.t_cam_head.tolist(),
    }


def _camera(entry: dict, unit: float) -> Camera:
    """A camera of the data; its matrix is made a rotation, its pixels square."""
    K = np.array(entry["K"])
    U, _, Vt = np.linalg.svd(np.array(entry["R"]))
    return Camera(
        width=entry["width"],
        height=entry["height"],
        focal_px=float(K[0, 0] + K[1, 1]) / 2,
        R_cam_head=U @ Vt,
        t_cam_head=np.array(entry["t"]) * unit,
        principal_px=K[:2, 2],
    )


def face_samples(
    mesh: Mesh, cameras: list[Camera], near: Float[Array, "n 3"], *, height: int = 350
) -> Samples:
    """What a head's own cameras see of its face, so that mouth cavity and sockets do not count.

    Args:
        mesh: the fitted head.
        cameras: its cameras; every pixel of an image of this height gives a sample.
        near: (N, 3) mm, the landmarks' attachments on the same head.
    """
    mesh = mesh.submesh(mesh.triangles_of(*shown_parts(mesh)))
    tree = cKDTree(near)
    triangles, barycentrics = [], []
    for camera in cameras:
        raster = rasterize_mesh(mesh, camera.resized(height / camera.height))
        corners = mesh.triangles[raster.triangle_ids[raster.mask]]
        samples = Samples(corners, raster.barycentrics[raster.mask].astype(np.float64))
        close = tree.query(samples.on(mesh.vertices))[0] < FACE_RADIUS_MM
        triangles.append(samples.triangles[close])
        barycentrics.append(samples.barycentrics[close])
    return Samples(np.concatenate(triangles), np.concatenate(barycentrics))


def start_from_shared_pixels(
    scan: Scan, mesh: Mesh, camera: Camera, true_camera: Camera, *, height: int = 250
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Points of the head and of the scan that are seen through the same pixels of one photo."""
    scanned = scan_mesh(scan)
    shown = mesh.submesh(mesh.triangles_of(*shown_parts(mesh)))
    factor = height / camera.height
    on_head, seen = _seen_points(shown, camera.resized(factor))
    on_scan, scan_seen = _seen_points(scanned, true_camera.resized(factor))
    both = seen & scan_seen
    return on_head[both], on_scan[both]


def _seen_points(mesh: Mesh, camera: Camera) -> tuple[Float[Array, "p 3"], Array]:
    """The surface behind every pixel, row by row, and where there is any."""
    raster = rasterize_mesh(mesh, camera)
    rows, columns = np.mgrid[: camera.height, : camera.width] + 0.5
    depth = np.where(raster.mask, raster.depth, 1.0).astype(np.float64)
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    return camera.unproject(pixels, depth.ravel()), raster.mask.ravel()


def similarity(source: Float[Array, "n 3"], target: Float[Array, "n 3"]) -> Float[Array, "4 4"]:
    """The similarity that takes source nearest to target, as a matrix."""
    found = estimate_similarity(source, target)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = found.scale * found.rotation, found.translation
    return T


def move(T: Float[Array, "4 4"], points: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """Points under a 4x4 transform."""
    return points @ T[:3, :3].T + T[:3, 3]


def distance_to(
    scan: Scan, points: Float[Array, "n 3"], T_start: Float[Array, "4 4"]
) -> Comparison:
    """Errors of a head's samples, (N, 3) mm, as T_start puts them on the scan and after ICP."""
    T = iterate_closest_points(scan, points[:: max(1, len(points) // ALIGNING)], T_start)
    before, after = (scan.nearest(move(matrix, points))[1] for matrix in (T_start, T))
    return Comparison(SurfaceError.of(before), SurfaceError.of(after), T)


def iterate_closest_points(
    scan: Scan, points: Float[Array, "n 3"], T: Float[Array, "4 4"], *, rounds: int = 200
) -> Float[Array, "4 4"]:
    """ICP by a similarity, the worst 5 % dropped in every round, until nothing moves 0.002 mm."""
    for _ in range(rounds):
        moved = move(T, points)
        closest, distances = scan.nearest(moved)
        keep = distances <= np.quantile(distances, 1 - TRIM)
        step = similarity(moved[keep], closest[keep])
        T = step @ T
        if np.abs(move(step, moved) - moved).max() < 2e-3:
            break
    return T


def relative_rotation_error(cameras: Mapping[str, Camera], scan: Scan) -> list[float]:
    """Degrees between the true and the fitted turn from the first photo to each other one."""
    names = sorted(set(cameras) & set(scan.cameras))
    fitted = [_straightened(cameras[name]) for name in names]
    true = [_straightened(scan.cameras[name]) for name in names]
    return [
        float(np.degrees(angle_between(a @ fitted[0].T, b @ true[0].T)))
        for a, b in zip(fitted[1:], true[1:], strict=True)
    ]


def _straightened(camera: Camera) -> Float[Array, "3 3"]:
    """The rotation of the camera that looks along the ray through the image's centre.

    A photo cropped off its centre shows nearly what a camera turned to that crop would, and a fit
    that takes the image's centre for the principal point finds that camera.
    """
    centre = np.array([[camera.width / 2, camera.height / 2]])
    x, y = ((centre - camera.principal) / camera.focal_px)[0]
    forward = np.array([x, y, 1.0]) / np.linalg.norm([x, y, 1.0])
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward]) @ camera.R_cam_head
