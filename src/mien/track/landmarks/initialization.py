"""Initialization: a known head found in a picture by the landmark detector alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.faces.detector import (
    LandmarkDetector,
    detect_around,
    is_same_face,
    refine_small_face,
)
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS, DetectedFace
from mien.errors import EstimationError
from mien.head import Head
from mien.reconstruction.expression.gaze import (
    MAX_GAZE_RAD,
    direction_to_iris,
    yaw_pitch_from_directions,
)
from mien.rig.gaze import SIDES
from mien.rig.rig import Rig
from mien.track.landmarks.detector_bias import DetectorProbe
from mien.track.landmarks.fit import LandmarkObservation, PoseAndFace, fit_face
from mien.track.landmarks.model import build_landmark_model
from mien.track.state import Layout, TrackState

_MAX_WEIGHT_SUM = 1.5
_SEARCH_RADIUS_MM = 200.0
"""Around a head's expected origin: searched if no face is detected there in the whole picture."""
_IRISES = [LEFT_IRIS, RIGHT_IRIS]
_LIDS = np.array([[386, 374], [159, 145]])
"""Landmarks in the middle of the upper and the lower lid, of the left and the right eye."""
_CLOSED, _OPEN = 0.25, 0.6
"""Shares of the neutral gap between the lids: the weight of an eye rises from 0 at the first to 1
at the second, for the iris of a closed eye is not seen."""


class HeadDetection(NamedTuple):
    """A head fitted to a detected face.

    Attributes:
        state: pose and face.
        rms_mm: RMS distance of the face's landmarks from the head's.
    """

    state: TrackState
    rms_mm: float


class HeadDetector:
    """Finds one head in pictures of any size.

    When it is made, the landmarks of the head are measured, which takes a second.

    Attributes:
        model: the landmarks of this head.
        layout: of the states.

    Args:
        head: that is sought.
        layout: of the states.
        detector: of landmarks.
        rig: of the head, if there is one already.

    Raises:
        InputError: as Rig; a layout that is not the head's.
    """

    def __init__(
        self, head: Head, layout: Layout, detector: LandmarkDetector, *, rig: Rig | None = None
    ) -> None:
        rig = Rig(head) if rig is None else rig
        self.layout, self._detector = layout, detector
        self._probe = DetectorProbe(rig, head.mesh, detector)
        self.model = build_landmark_model(rig, head.mesh, layout, self._probe)
        self._gaze_estimator = _GazeEstimator(head, rig, layout, self.model.positions)

    def detect(
        self, pixels: UInt8[Array, "h w 3"], *, focal_px: float, small: bool = False
    ) -> list[HeadDetection]:
        """The head fitted to every face that it can be fitted to, the largest face first.

        Args:
            pixels: sRGB.
            focal_px: of the picture as it is given.
            small: only faces that are too small to be detected in the whole picture.
        """
        size = (pixels.shape[1], pixels.shape[0])
        faces = self.detect_small_faces(pixels) if small else self.detect_faces(pixels)
        detections = (self.fit(face, size=size, focal_px=focal_px) for face in faces)
        return [detection for detection in detections if detection is not None]

    def detect_near(
        self, pixels: UInt8[Array, "h w 3"], t_cam_head: Float[Array, " 3"], *, focal_px: float
    ) -> TrackState | None:
        """The head fitted to the face nearest to an expected position; None where there is none.

        Args:
            pixels: sRGB.
            t_cam_head: (3,) mm, the expected position.
            focal_px: of the picture as it is given.
        """
        size = (pixels.shape[1], pixels.shape[0])
        x, y = focal_px * t_cam_head[:2] / t_cam_head[2] + np.array(size) / 2
        radius = focal_px * _SEARCH_RADIUS_MM / t_cam_head[2]
        faces = self._detector.detect_all_fast(pixels)
        near = [face for face in faces if _distance_px(face, (x, y)) < face.width]
        # A small face may not be detected in the whole picture.
        near = near or detect_around(self._detector, pixels, (x, y), radius)
        if not near:
            return None
        face = min(near, key=lambda face: _distance_px(face, (x, y)))
        detection = self.fit(
            refine_small_face(self._detector, pixels, face), size=size, focal_px=focal_px
        )
        return detection and detection.state

    def detect_faces(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Every face, the largest first; small ones are detected again in a crop."""
        faces = self._detector.detect_all_fast(pixels)
        return [refine_small_face(self._detector, pixels, face) for face in faces]

    def detect_small_faces(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Faces that are too small to be detected in the whole picture, 70 ms."""
        large = self._detector.detect_all_fast(pixels)
        return [
            refine_small_face(self._detector, pixels, face)
            for face in self._detector.detect_in_tiles(pixels)
            if not any(is_same_face(face, other) for other in large)
        ]

    def fit(
        self, face: DetectedFace, *, size: tuple[int, int], focal_px: float
    ) -> HeadDetection | None:
        """The head fitted to a detected face; None where it cannot be.

        Args:
            face: in px of the picture.
            size: the picture's width and height, px.
            focal_px: the picture's.
        """
        observation = LandmarkObservation.from_detection(self.model, face, size)
        try:
            estimate = fit_face(
                observation, self.layout, focal_px, initial=observation.initial_pose(focal_px)
            )
        except EstimationError:
            return None
        return HeadDetection(
            self._state(estimate, face, size, focal_px), observation.rms_mm(estimate, focal_px)
        )

    def bias_corrected(
        self,
        observation: LandmarkObservation,
        estimate: PoseAndFace,
        size: tuple[int, int],
        focal_px: float,
    ) -> LandmarkObservation:
        """An observation less the detector's errors in a rendered picture of an estimate, 15 ms.

        Unchanged where no face is detected in that picture.

        Args:
            observation: of a picture.
            estimate: of its head.
            size: the picture's width and height, px.
            focal_px: the picture's.
        """
        camera = Camera(*size, focal_px, estimate.R, estimate.t)
        weights, units = self._weights(estimate.face)
        state = TrackState(estimate.R, estimate.t, weights, units, np.zeros(2)).face(self.layout)
        rendered = self._probe.detect(state, camera)
        if rendered is None:
            return observation
        return observation.bias_corrected(rendered, estimate, size, focal_px)

    def _state(
        self, estimate: PoseAndFace, face: DetectedFace, size: tuple[int, int], focal_px: float
    ) -> TrackState:
        camera = Camera(*size, focal_px, estimate.R, estimate.t)
        weights, units = self._weights(estimate.face)
        gaze = self._gaze_estimator.gaze(camera, face.points[:, :2], weights)
        return TrackState(estimate.R, estimate.t, weights, units, gaze)

    def _weights(self, face: Float[Array, " p"]) -> tuple[Array, Array]:
        """(R, K) blending weights, neutral first, and (U,) of units."""
        regions, expressions = len(self.layout.regions), len(self.layout.expressions) - 1
        mixed = face[: regions * expressions].reshape(regions, expressions)
        sums = mixed.sum(axis=1, keepdims=True)
        mixed = mixed * np.minimum(1, _MAX_WEIGHT_SUM / np.maximum(sums, 1e-9))
        weights = np.column_stack([1 - mixed.sum(axis=1), mixed])
        return weights, face[regions * expressions :]


def _distance_px(face: DetectedFace, point: tuple[float, float]) -> float:
    """Px from the middle between a face's eyes."""
    return float(np.linalg.norm(face.points[_IRISES, :2].mean(axis=0) - point))


class _GazeEstimator:
    """The eyes of one head, with the positions of their irises and lids in its neutral face."""

    def __init__(
        self, head: Head, rig: Rig, layout: Layout, positions: Float[Array, "478 3"]
    ) -> None:
        generic = load_generic_head()
        balls = [generic.mesh.vertices_of(f"{side}_eyeball") for side in SIDES]
        self._centres = np.array([head.mesh.vertices[ball].mean(axis=0) for ball in balls])
        forward = positions[_IRISES] - self._centres
        self._radii = np.linalg.norm(forward, axis=1)
        self._forward = yaw_pitch_from_directions(forward / self._radii[:, None])
        self._lids = positions[_LIDS]
        masks = np.stack([rig.mask(region) for region in layout.regions])
        self._region_weights = np.stack([masks[:, ball[0]] for ball in balls])
        expressed = [head.expressions[name].gaze for name in layout.expressions]
        self._expressed = np.stack(expressed, axis=1)

    def gaze(
        self, camera: Camera, points: Float[Array, "478 2"], weights: Float[Array, "r k"]
    ) -> Float[Array, " 2"]:
        """(2,) rad, yaw and pitch in addition to the expressions'; 0 where both eyes are closed."""
        directions = np.stack(
            [
                direction_to_iris(camera, points[iris], centre, radius)
                for iris, centre, radius in zip(
                    _IRISES, self._centres, self._radii.tolist(), strict=True
                )
            ]
        )
        by_expressions = np.einsum("er,rk,ekc->ec", self._region_weights, weights, self._expressed)
        angles = yaw_pitch_from_directions(directions) - self._forward - by_expressions
        gaze: Array = self._eye_weights(camera, points) @ angles
        return np.clip(gaze, -MAX_GAZE_RAD, MAX_GAZE_RAD)

    def _eye_weights(self, camera: Camera, points: Float[Array, "478 2"]) -> Float[Array, " 2"]:
        """(2,) weights of the eyes' directions, at most 1 in total; 0 of a nearly closed eye."""
        gaps = np.linalg.norm(np.diff(points[_LIDS], axis=1)[:, 0], axis=1)
        neutral = np.diff(camera.project(self._lids.reshape(-1, 3)).reshape(2, 2, 2), axis=1)[:, 0]
        openness = gaps / np.maximum(np.linalg.norm(neutral, axis=1), 1e-9)
        weights = np.clip((openness - _CLOSED) / (_OPEN - _CLOSED), 0, 1)
        return weights / max(float(weights.sum()), 1.0)
