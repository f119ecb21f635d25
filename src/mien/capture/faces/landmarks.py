"""The detector's 478 landmarks of a face, with a confidence for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array, check_rotation, frozen
from mien.assets.landmark_sets import LANDMARK_COUNT
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS, DetectedFace

CUT_TOLERANCE = 0.02
"""Of the face's width: how far outside of the picture a point of an uncut face may lie."""


@dataclass(frozen=True)
class Landmarks:
    """The detector's result for one face.

    Attributes:
        points: (478, 2) px of the photo.
        confidence: (478,) in [0, 1]: 1 where the surface faces the camera, 0 where it turns away;
            roughly the inverse of the relative error; 0 outside of the photo.
        blendshapes: (52,) scores in [0, 1], ordered as `BLENDSHAPE_NAMES`: `_neutral`, then 51 of
            the ARKit units (no `tongueOut`).
        R_cam_head: (3, 3) the detector's rotation of the head; good to some 10 degrees.
        notes: what was odd.
    """

    points: Float[Array, "478 2"]
    confidence: Float[Array, " 478"]
    blendshapes: Float[Array, " 52"]
    R_cam_head: Float[Array, "3 3"]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, shape in (
            ("points", (LANDMARK_COUNT, 2)),
            ("confidence", (LANDMARK_COUNT,)),
            ("blendshapes", (52,)),
        ):
            object.__setattr__(self, name, frozen(check_array(name, getattr(self, name), shape)))
        object.__setattr__(
            self, "R_cam_head", frozen(check_rotation("R_cam_head", self.R_cam_head))
        )

    def as_detected_face(self) -> DetectedFace:
        """The same as a detection in a frame, with depth 0."""
        points = np.column_stack([self.points, np.zeros(LANDMARK_COUNT)])
        return DetectedFace(points, self.blendshapes, self.R_cam_head)

    @property
    def eye_distance_px(self) -> float:
        """Between the irises, in the image."""
        return float(np.linalg.norm(self.points[LEFT_IRIS] - self.points[RIGHT_IRIS]))


def inside_picture(
    points: Float[Array, "n 2"], size: tuple[int, int] | Int[Array, " 2"]
) -> Bool[Array, " n"]:
    """Which points lie in a picture of this width and height; the others are extrapolated."""
    return np.all((points >= 0) & (points <= np.asarray(size)), axis=1)


def is_cut(points: Float[Array, "n 2"], size: tuple[int, int] | Int[Array, " 2"]) -> bool:
    """Whether the edge of a picture of this width and height cuts a face with these points."""
    room = CUT_TOLERANCE * float(np.ptp(points[:, 0]))
    return bool(((points < -room) | (points > np.asarray(size) + room)).any())


def cut_note(points: Float[Array, "n 2"], size: tuple[int, int]) -> tuple[str, ...]:
    """A note where the edge of the picture cuts the face; none where it does not."""
    if not is_cut(points, size):
        return ()
    count = int((~inside_picture(points, size)).sum())
    outside = f"{count} of its {len(points)} points lie outside of the picture"
    return (f"the edge cuts the face, {outside}: they are a guess",)


def facing_confidence(
    points: Float[Array, "n 3"], R_cam_head: Float[Array, "3 3"]
) -> Float[Array, " n"]:
    """A weight in [0, 1] by the angle between the surface under each landmark and the camera.

    Measured on seven views of a scan with known cameras (yaw -64 to 48 degrees): the distance
    between a landmark and the projection of its triangulated place is 2.6 px in the median where
    the surface faces the camera (cosine 0.95), 5.3 at 0.55, 9.1 at 0.35, 15 at 0.15 and over 20
    behind the contour. The ramp from 0.1 to 0.9 is the ratio of these. A test for occlusion by the
    nose and cheek added nothing to it.

    Args:
        points: x, y in px and z forward in the same scale.
        R_cam_head: turns them back to a frontal face, over whose x and y they are triangulated.
    """
    from scipy.spatial import Delaunay

    frontal = (points - points.mean(axis=0)) @ R_cam_head
    triangles = Delaunay(frontal[:, :2]).simplices
    normals = _vertex_normals(frontal, triangles)
    facing = -(normals @ R_cam_head.T)[:, 2]
    return np.clip((facing - 0.1) / 0.8, 0.0, 1.0)


def _vertex_normals(points: Float[Array, "n 3"], triangles: Int[Array, "f 3"]) -> Array:
    """(n, 3) unit normals with positive z, weighted by area."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    face_normals = np.cross(b - a, c - a)
    face_normals *= np.where(face_normals[:, 2:] < 0, -1.0, 1.0)
    normals = np.zeros_like(points)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], face_normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(float).tiny)
