"""The bias of a landmark detector, measured in rendered pictures of a known head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES, DetectedFace
from mien.mesh import Mesh
from mien.numeric.rotation import cross_matrix
from mien.render.morph import MorphRenderer
from mien.render.orbit import orbit_camera
from mien.render.picture import GREY
from mien.rig.rig import Rig
from mien.rig.state import FaceState, PosedFace

_VIEWS = np.radians(
    [
        [0.0, 0.0, 35.0],
        [-20.0, 8.0, 35.0],
        [20.0, 8.0, 35.0],
        [-28.0, -6.0, 35.0],
        [28.0, -6.0, 35.0],
        [0.0, 16.0, 35.0],
        [0.0, -14.0, 35.0],
        [0.0, 0.0, 65.0],
        [0.0, 0.0, 18.0],
    ]
)
"""Yaw, pitch and angle of view, radians, of the cameras that a face is rendered from."""
ALL_VIEWS = len(_VIEWS)
_SIZE, _MAX_SIDE = (320, 400), 640
_PRIOR_WEIGHT = 0.03
"""Weight of the prior that a landmark has no bias, where one view has 1: ridge regression."""
_REFERENCE_MM = 600.0


@dataclass(frozen=True)
class ProbeDetection:
    """A detector's result in a picture whose camera is known."""

    camera: Camera
    face: DetectedFace


@dataclass(frozen=True)
class DetectorBias:
    """Where a detector finds its landmarks on a face in one state, relative to its surface points.

    Attributes:
        positions: (478, 3) mm, the surface points that the generic head assigns to the landmarks.
        offsets: (478, 3) mm from there to where the detector finds them.
        view_slopes: (3, 478, 3) mm by which the offsets change with each viewpoint coordinate.
        residuals: (V, 478, 2) mm that remain in each of V pictures; NaN where the surface faces
            away.
        scores: (52,) the detector's scores of the units, their mean over the pictures.
    """

    positions: Float[Array, "478 3"]
    offsets: Float[Array, "478 3"]
    view_slopes: Float[Array, "3 478 3"]
    residuals: Float[Array, "v 478 2"]
    scores: Float[Array, " 52"]

    @property
    def detected(self) -> bool:
        """False where the detector found no face in any picture."""
        return len(self.residuals) > 0

    def change_from(self, other: DetectorBias) -> tuple[Float[Array, "478 3"], Float[Array, " 52"]]:
        """Differences of landmarks, mm, and scores from those of another state of the same face."""
        change = self.positions - other.positions
        if not (self.detected and other.detected):
            return change, np.zeros_like(self.scores)
        return change + self.offsets - other.offsets, self.scores - other.scores


class DetectorProbe:
    """Renders one head and runs the detector on the pictures.

    Args:
        rig: of the head.
        mesh: the head's, in its neutral face.
        detector: that is measured.
    """

    def __init__(self, rig: Rig, mesh: Mesh, detector: LandmarkDetector) -> None:
        self._rig, self._mesh, self._detector = rig, mesh, detector
        self._renderer = MorphRenderer(mesh, rig.textures)
        width, height = _SIZE
        self._cameras = [
            orbit_camera(yaw, pitch, width=width, height=height, vertices=mesh.vertices, fov=fov)
            for yaw, pitch, fov in _VIEWS.tolist()
        ]

    def detect(self, state: FaceState, camera: Camera) -> DetectedFace | None:
        """The face detected in a rendered picture, in px of the camera; None where there is none.

        Args:
            state: of the face.
            camera: that the picture is rendered for.
        """
        return self._detect(self._rig.evaluate(state), camera)

    def _detect(self, face: PosedFace, camera: Camera) -> DetectedFace | None:
        factor = min(1.0, _MAX_SIDE / max(camera.width, camera.height))
        picture = self._renderer.render(face, camera.resized(factor), samples=1, background=GREY)
        found = self._detector.detect_fast(np.ascontiguousarray(picture[..., :3]))
        return found and replace(found, points=found.points / factor)

    def measure_bias(
        self,
        state: FaceState,
        views: int = ALL_VIEWS,
        view_slopes: Float[Array, "3 478 3"] | None = None,
    ) -> DetectorBias:
        """The detector's bias on the head in one state.

        Args:
            state: of the face.
            views: from how many viewpoints it is rendered.
            view_slopes: (3, 478, 3) as DetectorBias', where they are known already.
        """
        generic, face = load_generic_head(), self._rig.evaluate(state)
        pairs = [(camera, self._detect(face, camera)) for camera in self._cameras[:views]]
        detections = [ProbeDetection(camera, found) for camera, found in pairs if found is not None]
        positions = generic.landmark_positions(face.vertices)
        normals = landmark_normals(generic, self._mesh.with_vertices(face.vertices))
        return estimate_bias(positions, normals, detections, view_slopes=view_slopes)


def estimate_bias(
    positions: Float[Array, "478 3"],
    normals: Float[Array, "478 3"],
    detections: Sequence[ProbeDetection],
    *,
    view_slopes: Float[Array, "3 478 3"] | None = None,
) -> DetectorBias:
    """A detector's bias by ridge regression over its results in pictures of one face.

    Args:
        positions: (478, 3) mm, surface points of the landmarks.
        normals: (478, 3) there.
        detections: none or some of one face.
        view_slopes: (3, 478, 3) as DetectorBias', where they are known; estimated otherwise.
    """
    viewpoints = [
        viewpoint(detection.camera.R_cam_head, detection.camera.t_cam_head)
        for detection in detections
    ]
    features = np.column_stack([np.ones(len(detections)), np.reshape(viewpoints, (-1, 3))])
    weights = np.reshape(
        [facing_weights(s.camera, positions, normals) for s in detections], (-1, len(positions))
    )
    residuals = np.reshape(
        [_residuals_mm(s, positions) for s in detections], (-1, len(positions), 2)
    )
    image_axes = np.reshape(
        [detection.camera.R_cam_head[:2] for detection in detections], (-1, 2, 3)
    )
    regressors = features
    if view_slopes is not None:
        residuals = residuals - np.einsum(
            "vf,flc,vac->vla", features[:, 1:], view_slopes, image_axes
        )
        regressors = features[:, :1]
    coefficients = _regression(residuals, weights, image_axes, regressors)
    residuals = residuals - np.einsum("vf,flc,vac->vla", regressors, coefficients, image_axes)
    residuals[weights == 0] = np.nan
    scores = [detection.face.blendshapes for detection in detections]
    return DetectorBias(
        positions,
        offsets=coefficients[0],
        view_slopes=coefficients[1:] if view_slopes is None else view_slopes,
        residuals=residuals,
        scores=np.mean(scores, axis=0) if scores else np.zeros(len(BLENDSHAPE_NAMES)),
    )


def viewpoint(
    R_cam_head: Float[Array, "3 3"], t_cam_head: Float[Array, " 3"]
) -> Float[Array, " 3"]:
    """(3,) coordinates of the viewpoint.

    They are x and y of the unit vector from the head to the camera, in head space, and 600 mm over
    its distance, less 1.
    """
    distance = float(np.linalg.norm(t_cam_head))
    x, y, _ = -R_cam_head.T @ t_cam_head / distance
    return np.array([x, y, _REFERENCE_MM / distance - 1])


def viewpoint_jacobian(
    R_cam_head: Float[Array, "3 3"], t_cam_head: Float[Array, " 3"]
) -> Float[Array, "3 6"]:
    """(3, 6) derivatives of the viewpoint by a pose step (reconstruction.bundle.projection)."""
    distance = float(np.linalg.norm(t_cam_head))
    direction = t_cam_head / distance
    jacobian = np.zeros((3, 6))
    jacobian[:2, :3] = -(R_cam_head.T @ cross_matrix(direction))[:2]
    by_translation = np.vstack(
        [
            -(R_cam_head.T @ (np.eye(3) - np.outer(direction, direction)))[:2] / distance,
            -_REFERENCE_MM / distance**2 * direction,
        ]
    )
    jacobian[:, 3:] = by_translation * [1.0, 1.0, t_cam_head[2]]
    return jacobian


def _residuals_mm(detection: ProbeDetection, points: Float[Array, "l 3"]) -> Float[Array, "l 2"]:
    """(L, 2) mm, along the picture's axes, of detected landmarks from projected surface points."""
    camera = detection.camera
    mm_per_px = camera.to_camera(points)[:, 2:] / camera.focal_px
    return (detection.face.points[:, :2] - camera.project(points)) * mm_per_px


def _regression(
    residuals: Float[Array, "v l 2"],
    weights: Float[Array, "v l"],
    image_axes: Float[Array, "v 2 3"],
    features: Float[Array, "v f"],
) -> Float[Array, "f l 3"]:
    """(F, L, 3) mm: coefficients of landmark offsets on the features of the views."""
    count = 3 * features.shape[1]
    rows = np.einsum("vf,vac->vafc", features, image_axes).reshape(len(features), 2, count)
    matrix = np.einsum("vl,vai,vaj->lij", weights, rows, rows) + _PRIOR_WEIGHT * np.eye(count)
    right = np.einsum("vl,vai,vla->li", weights, rows, residuals)
    solution = np.linalg.solve(matrix, right[..., None]).reshape(-1, features.shape[1], 3)
    return np.ascontiguousarray(solution.transpose(1, 0, 2))


def facing_weights(
    camera: Camera, points: Float[Array, "n 3"], normals: Float[Array, "n 3"]
) -> Float[Array, " n"]:
    """(N,) in [0, 1]: weights of surface points, mm, in a view; 0 where the surface faces away."""
    to_camera = camera.center - points
    return cosine_weights((normals * to_camera).sum(axis=1) / np.linalg.norm(to_camera, axis=1))


def cosine_weights(cosine: Float[Array, " n"]) -> Float[Array, " n"]:
    """(N,) by the cosine of normal and view: the ramp of landmarks.facing_confidence."""
    return np.clip((cosine - 0.1) / 0.8, 0.0, 1.0)


def landmark_normals(generic: GenericHead, mesh: Mesh) -> Float[Array, "478 3"]:
    """(478, 3) unit normals of a head's surface at the landmarks."""
    normals = at_landmarks(generic, mesh.vertex_normals())
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def at_landmarks(generic: GenericHead, values: Float[Array, "*k v c"]) -> Float[Array, "*k 478 c"]:
    """(..., 478, C) values of vertices, (..., V, C), interpolated at the landmarks."""
    corners = generic.mesh.triangles[generic.landmark_triangles]
    return np.einsum("lc,...lcd->...ld", generic.landmark_barycentrics, values[..., corners, :])
