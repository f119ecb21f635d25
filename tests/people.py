"""People that are known exactly, photographed by cameras that are known exactly."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.annotations import Annotations
from mien.capture.faces.landmarks import Landmarks
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.numeric.rotation import angle_between, rotation_from_vector

SIZE = (1000, 1300)
PX_PER_MM = 3.8
ANGLES = ((-50, 5, 2), (-20, -8, -3), (5, 10, 0), (30, -5, 4), (55, 0, -2))
"""Yaw, pitch and roll of five cameras around a face, degrees."""


def person(seed: int) -> Array:
    """(V, 3) mm: the vertices of somebody drawn from the identity basis."""
    generic = load_generic_head()
    coefficients = np.random.default_rng(seed).normal(size=len(generic.identity.components))
    return generic.mesh.vertices + generic.identity.offsets(coefficients)


def camera(yaw: float, pitch: float = 0.0, roll: float = 0.0, *, distance: float = 700.0) -> Camera:
    """A camera that looks at the middle of the face from here (degrees, mm)."""
    turns = rotation_from_vector(np.radians([[0, 0, roll], [pitch, 0, 0], [0, yaw, 0]]))
    rotation = turns[0] @ np.diag([1.0, -1.0, -1.0]) @ turns[1] @ turns[2]
    target = np.array([0.0, -30.0, 0.0])
    place = np.array([0, 0, distance]) - rotation @ target
    return Camera(*SIZE, PX_PER_MM * distance, rotation, place)


def cameras() -> list[Camera]:
    """Five cameras around the face."""
    return [camera(*angles) for angles in ANGLES]


def feature_vertices(names: Iterable[str]) -> list[int]:
    """The generic head's vertices of these features."""
    return [load_generic_head().vertex_of(name) for name in names]


def drawn(vertices: Array, name: str) -> Array:
    """(M, 3) mm: a polyline of this person, closely sampled."""
    line = vertices[list(load_generic_head().polylines[name])]
    steps = np.arange(len(line))
    fine = np.linspace(0, len(line) - 1, 20 * (len(line) - 1) + 1)
    return np.column_stack([np.interp(fine, steps, line[:, axis]) for axis in range(3)])


def photographed(
    vertices: Array,
    seen_from: Camera,
    *,
    name: str = "photo.png",
    points: Sequence[str] | None = None,
    curves: Sequence[str] = (),
    landmarks: bool = False,
) -> CapturedView:
    """A black photo of this person with exact marks.

    Args:
        points: names to mark; by default every feature there is.
        curves: polylines to draw.
        landmarks: whether a perfect detector saw the photo too.
    """
    generic = load_generic_head()
    names = generic.feature_names if points is None else points
    places = seen_from.project(vertices[feature_vertices(names)])
    lines = {name: seen_from.project(drawn(vertices, name)) for name in curves}
    marks = Annotations(dict(zip(names, places, strict=True)), lines)
    seen = seen_from.project(generic.landmark_positions(vertices))
    detected = Landmarks(seen, np.ones(478), np.zeros(52), seen_from.R_cam_head)
    photo = Photo(name, Path(name), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    return CapturedView(photo, detected if landmarks else None, marks or None)


def turns_between(views: Sequence[Camera]) -> Array:
    """(K, K, 3, 3) rotations from each camera's space to each other's: no head's frame counts."""
    rotations = np.stack([item.R_cam_head for item in views])
    return np.einsum("aij,bkj->abik", rotations, rotations)


def camera_errors(found: Sequence[Camera], true: Sequence[Camera]) -> tuple[float, float]:
    """Largest error of a rotation between two cameras, degrees, and of a focal length, relative."""
    turned = angle_between(turns_between(found), turns_between(true))
    focal = [a.focal_px / b.focal_px - 1 for a, b in zip(found, true, strict=True)]
    return float(np.degrees(turned.max())), float(np.abs(focal).max())
