"""Where the detector's 478 landmarks lie on the generic head.

The detector looks at shaded pictures of the head from several sides; its points are cast back
onto the mesh, and what the views and the two halves of the face say is averaged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.optimize import linear_sum_assignment

from mien.arrays import Array, Bool, Float, Int, UInt8
from mien.camera import Camera
from mien.mesh import Mesh
from tools.assets.shading import Lighting, Paint, camera_at, rasterize_mesh, shade

YAWS = (-30.0, -15.0, 0.0, 15.0, 30.0)
LIGHTINGS = (
    Lighting(),
    Lighting(light=(-0.6, -0.4, -1.0)),
    Lighting(light=(0.0, -0.8, -1.0), ambient=0.45),
    Lighting(light=(0.5, -0.1, -1.0), brightness=0.55),
)
_IRISES = slice(468, 478)
_SIZE = 900
# A view counts only where the surface faces it by at least this cosine.
_LEAST_COSINE = 0.3
# On the half of the face that is turned away, only landmarks this near to the middle count: those
# farther out lie on the silhouette, wherever that happens to be.
_MIDDLE_MM = 25.0
# A ray may miss the surface by this much.
_LARGEST_GAP_MM = 3.0
# Beyond this disagreement between views a landmark has no place on the mesh.
_LARGEST_SPREAD_MM = 6.0


@dataclass(frozen=True)
class Attachments:
    """The landmarks' places.

    Attributes:
        triangles: (478,) triangle under each landmark.
        barycentrics: (478, 3) place in it.
        attached: (478,) whether the place is to be trusted.
        spread_mm: (478,) weighted mean distance of the views' casts from the place.
        partners: (478,) each landmark's left-right partner.
    """

    triangles: Int[Array, " n"]
    barycentrics: Float[Array, "n 3"]
    attached: Bool[Array, " n"]
    spread_mm: Float[Array, " n"]
    partners: Int[Array, " n"]


def attach(mesh: Mesh, paint: Paint, allowed: Bool[Array, " f"], model: bytes) -> Attachments:
    """Places the detector's landmarks on the mesh.

    Args:
        mesh: as the detector shall see it.
        paint: colours of the head.
        allowed: (F,) triangles that a landmark may lie on: skin seen from outside, eyeballs.
        model: the face landmarker's model.
    """
    casts, weights = [], []
    with _Detector(model) as detector:
        camera = camera_at(0, size=_SIZE)
        pictures = [shade(mesh, camera, paint, lighting) for lighting in LIGHTINGS]
        frontal = np.mean([detector.landmarks(picture) for picture in pictures], axis=0)
        sideways = (frontal[:, 0] - _SIZE / 2) / camera.focal_px * camera.t_cam_head[2]
        for camera, image, yaw in _pictures(mesh, paint):
            cast, weight = _cast(mesh, camera, detector.landmarks(image), allowed)
            casts.append(cast)
            weights.append(weight * (sideways * np.sign(yaw) > -_MIDDLE_MM))
    partners = _partners(frontal)
    stacked = np.stack(casts + [cast[partners] * [-1, 1, 1] for cast in casts])
    shares = np.stack(weights + [weight[partners] for weight in weights])
    middles = _geometric_medians(stacked, shares)
    triangles, barycentrics = _snap(middles, mesh, allowed)
    places = (mesh.vertices[mesh.triangles[triangles]] * barycentrics[..., None]).sum(1)
    distances = np.linalg.norm(stacked - places, axis=2)
    spread = (distances * shares).sum(0) / np.maximum(shares.sum(0), 1e-9)
    attached = (shares.sum(0) > 0) & (spread < _LARGEST_SPREAD_MM)
    return Attachments(triangles, barycentrics, attached, spread, partners)


def _geometric_medians(
    points: Float[Array, "k n 3"], weights: Float[Array, "k n"], iterations: int = 30
) -> Float[Array, "n 3"]:
    """The place with the least weighted sum of distances to each landmark's casts (Weiszfeld).

    A mean would be drawn aside by the views in which a landmark falls past the nose onto the
    cheek behind.
    """
    shares = weights
    for _ in range(iterations):
        total = np.maximum(shares.sum(0), 1e-9)
        middles: Array = (points * shares[..., None]).sum(0) / total[:, None]
        shares = weights / np.maximum(np.linalg.norm(points - middles, axis=2), 0.05)
    return middles


def _snap(
    points: Float[Array, "478 3"], mesh: Mesh, allowed: Bool[Array, " f"]
) -> tuple[Int[Array, " 478"], Float[Array, "478 3"]]:
    """The nearest places on the allowed skin, for the irises on the eyeballs."""
    eyes = [mesh.part_names.index(f"{side}_eyeball") for side in ("left", "right")]
    on_eye = np.isin(mesh.part, eyes)
    of_iris = np.zeros(len(points), bool)
    of_iris[_IRISES] = True
    triangles, barycentrics = np.empty(len(points), np.int64), np.empty((len(points), 3))
    for iris in (False, True):
        pick = of_iris == iris
        on = np.flatnonzero(allowed & (on_eye == iris))
        triangles[pick], barycentrics[pick] = closest_on_mesh(points[pick], mesh, on)
    return triangles, barycentrics


class _Detector:
    """MediaPipe's face landmarker."""

    def __init__(self, model: bytes) -> None:
        from mediapipe.tasks.python import BaseOptions, vision

        options = vision.FaceLandmarkerOptions(
            base_options=BaseOptions(model_asset_buffer=model), output_face_blendshapes=True
        )
        self._landmarker = vision.FaceLandmarker.create_from_options(options)

    def __enter__(self) -> _Detector:
        return self

    def __exit__(self, *_: object) -> None:
        self._landmarker.close()

    def landmarks(self, image: UInt8[Array, "h w 3"]) -> Float[Array, "478 2"]:
        """Pixels of the landmarks. Raises: ValueError: no face."""
        import mediapipe

        height, width = image.shape[:2]
        wrapped = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=image)
        faces = self._landmarker.detect(wrapped).face_landmarks
        if not faces:
            raise ValueError("the detector finds no face in the picture of the generic head")
        return np.array([[point.x * width, point.y * height] for point in faces[0]])


def _pictures(mesh: Mesh, paint: Paint) -> Iterator[tuple[Camera, UInt8[Array, "h w 3"], float]]:
    for yaw in YAWS:
        camera = camera_at(yaw, size=_SIZE)
        for lighting in LIGHTINGS:
            yield camera, shade(mesh, camera, paint, lighting), yaw


def _cast(
    mesh: Mesh, camera: Camera, points: Float[Array, "n 2"], allowed: Bool[Array, " f"]
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """Where the points' rays meet the mesh, and how squarely (0 where they miss).

    A point in a gap (between the lips) or just past the silhouette is moved to the nearest pixel
    that shows an allowed triangle from the front.
    """
    raster = rasterize_mesh(mesh, camera)
    centres = mesh.vertices[mesh.triangles].mean(1)
    towards = camera.center - centres
    cosine = (mesh.triangle_normals() * towards).sum(1)
    cosine /= np.linalg.norm(mesh.triangle_normals(), axis=1) * np.linalg.norm(towards, axis=1)
    usable = raster.mask & (allowed & (cosine > _LEAST_COSINE))[raster.triangle_ids]
    gap, (rows, columns) = distance_transform_edt(~usable, return_indices=True)
    at = tuple(np.clip(points.astype(int), 0, _SIZE - 1).T[::-1])
    ids = raster.triangle_ids[rows[at], columns[at]]
    barycentrics = raster.barycentrics[rows[at], columns[at]]
    hits = (mesh.vertices[mesh.triangles[ids]] * barycentrics[..., None]).sum(1)
    near = gap[at] < _LARGEST_GAP_MM * camera.focal_px / camera.t_cam_head[2]
    return hits, np.where(near, cosine[ids] ** 2, 0.0)


def _partners(frontal: Float[Array, "n 2"]) -> Int[Array, " n"]:
    """Left-right partners: the pairing under which the frontal points mirror each other best."""
    mirrored = [_SIZE, 0] + frontal * [-1, 1]
    distances = np.linalg.norm(frontal[:, None] - mirrored[None], axis=2)
    return linear_sum_assignment(distances + distances.T)[1]


def closest_on_mesh(
    points: Float[Array, "n 3"], mesh: Mesh, triangles: Int[Array, " m"]
) -> tuple[Int[Array, " n"], Float[Array, "n 3"]]:
    """The nearest of the given triangles to each point and the barycentrics of the foot."""
    corners = mesh.vertices[mesh.triangles[triangles]]
    chosen, places = np.empty(len(points), np.int64), np.empty((len(points), 3))
    for index, point in enumerate(points):
        feet = _feet(point, corners)
        distances = np.linalg.norm((feet[..., None] * corners).sum(1) - point, axis=1)
        best = int(np.argmin(distances))
        chosen[index], places[index] = triangles[best], feet[best]
    return chosen, places


def _feet(point: Float[Array, " 3"], corners: Float[Array, "m 3 3"]) -> Float[Array, "m 3"]:
    """Barycentrics of the point of each triangle that is nearest to the point."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    candidates = [_edge_foot(point, a, b, 0, 1), _edge_foot(point, b, c, 1, 2)]
    candidates.append(_edge_foot(point, c, a, 2, 0))
    ab, ac, ap = b - a, c - a, point - a
    normal = np.cross(ab, ac)
    squared = np.maximum((normal**2).sum(1), 1e-18)
    v = (np.cross(ap, ac) * normal).sum(1) / squared
    w = (np.cross(ab, ap) * normal).sum(1) / squared
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    stacked = np.stack(candidates)
    gaps = np.linalg.norm((stacked[..., None] * corners).sum(2) - point, axis=2)
    best = stacked[gaps.argmin(0), np.arange(len(corners))]
    return np.where(inside[:, None], np.column_stack([1 - v - w, v, w]), best)


def _edge_foot(point: Array, start: Array, end: Array, i: int, j: int) -> Float[Array, "m 3"]:
    along = end - start
    squared = np.maximum((along**2).sum(1), 1e-18)
    t = np.clip(((point - start) * along).sum(1) / squared, 0, 1)
    feet = np.zeros((len(start), 3))
    feet[:, i], feet[:, j] = 1 - t, t
    return feet
