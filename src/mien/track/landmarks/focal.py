"""The focal length of a video from where its frames show the landmarks of a known head."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.errors import EstimationError, InputError
from mien.head import Head
from mien.numeric.rotation import angle_between
from mien.numeric.solvers.schur import BlockSystem
from mien.reconstruction.bundle.projection import CAMERA_SIZE
from mien.track.landmarks.detector_bias import at_landmarks
from mien.track.landmarks.fit import (
    MAX_WEIGHT,
    LandmarkObservation,
    LandmarkProblem,
    PoseAndFace,
    fit_face,
)
from mien.track.landmarks.initialization import HeadDetection, HeadDetector
from mien.track.landmarks.model import LANDMARK_SD_MM
from mien.track.lens import LogFocal, expected_focal

MAX_FOCAL_FRAMES = 8
"""More add little."""
_NEW_VIEW_RAD, _NEW_VIEW_LOG_DISTANCE = np.radians(5.0), 0.08
"""A frame is used if its head is rotated by this much, or nearer or farther by this much in log
distance, from all that were used: errors of landmarks in similar views are correlated."""
_SHAPE_COMPONENTS = 24
"""Identity components, the greatest first, that errors of the landmarks are modelled by."""
_PERSPECTIVE_RESPONSE = 0.65
"""The share of a change of perspective that the detector's landmarks show. In rendered pictures
they show the same share, so the estimate has no bias; but its precision is this much smaller."""
_MIN_ITERATIONS, _MAX_ITERATIONS, _TOLERANCE, _MAX_STEP = 3, 8, 0.01, 0.5
_SMALL_FACE_INTERVAL = 5
"""In every so many frames without a face of the head's, faces are sought that are too small to be
detected in the whole picture."""
_FOCAL = CAMERA_SIZE - 1
_UNINFORMATIVE = 0.7
"""The estimate is reported as the prior's if its deviation is more than this share of it."""


@dataclass(frozen=True)
class FocalEstimate:
    """A video's focal length.

    Attributes:
        focal_px: of its upright pictures.
        deviation: of its logarithm; 0.1 is about 10 %.
        frames_used: how many frames it was estimated from.
        note: one line for the user.
    """

    focal_px: float
    deviation: float
    frames_used: int
    note: str


class FocalEstimator:
    """Collects frames with different views of the head and solves for their common focal length.

    Common unknowns are the focal length and the error of the head's shape; those of each frame are
    the pose, the face, and the detector's error there. So a head that holds still determines
    little, however many frames there are.

    Args:
        detector: of the head.
        head: whose uncertainty is the deviation of its shape.
        size: width and height of the video's upright pictures.
        expected: the prior; see lens.expected_focal.
    """

    def __init__(
        self, detector: HeadDetector, head: Head, size: tuple[int, int], expected: LogFocal
    ) -> None:
        self._detector, self._size, self._expected = detector, size, expected
        components = _shape_components()
        spread = float(np.sqrt((components**2).sum(axis=(1, 2)).mean()))
        corners = load_generic_head().mesh.triangles[load_generic_head().landmark_triangles]
        shape_sd = float(np.median(head.uncertainty_mm[corners]))
        # (478, 3, W) mm at one standard deviation: of the shape, and of the detector in a frame.
        self._shape_offsets = components * (shape_sd / spread)
        self._detector_offsets = components * (np.sqrt(2) * LANDMARK_SD_MM / spread)
        self._observations: list[LandmarkObservation] = []
        self._estimates: list[PoseAndFace] = []
        self._mismatches: list[PoseAndFace] = []

    @property
    def frames_used(self) -> int:
        """How many frames are kept."""
        return len(self._observations)

    def add(
        self, face: DetectedFace, is_match: Callable[[HeadDetection], bool] = lambda result: True
    ) -> bool:
        """Keep a face if no other was seen in a similar view; False if it is not kept.

        Args:
            face: in px of the upright picture.
            is_match: whether the face is the head's.
        """
        if self.frames_used == MAX_FOCAL_FRAMES:
            return False
        observation = LandmarkObservation.from_detection(self._detector.model, face, self._size)
        focal = self._expected.focal_px
        try:
            estimate = fit_face(
                observation, self._detector.layout, focal, initial=observation.initial_pose(focal)
            )
        except EstimationError:
            return False
        if any(_same_view(estimate, other) for other in (*self._estimates, *self._mismatches)):
            return False
        result = self._detector.fit(face, size=self._size, focal_px=focal)
        if result is None or not is_match(result):
            self._mismatches.append(estimate)
            return False
        self._observations.append(observation)
        self._estimates.append(estimate)
        return True

    def estimate(self) -> LogFocal:
        """The focal length of highest posterior, and how well it is known.

        Raises:
            EstimationError: a landmark comes to lie behind the camera.
        """
        if not self._observations:
            return self._expected
        log_focal, shape = self._expected.mean, np.zeros(self._shape_offsets.shape[2])
        estimates, precision = self._estimates, self._expected.precision
        for done in range(_MAX_ITERATIONS):
            observations = self._bias_corrected(log_focal, estimates)
            system = self._system(log_focal, shape, observations, estimates)
            precision = 1 / float(system.covariance()[0][0, 0])
            step = system.solve(0.0)[0]
            focal_step = float(np.clip(step[0], -_MAX_STEP, _MAX_STEP))
            log_focal, shape = log_focal + focal_step, shape + step[1:]
            if abs(focal_step) < _TOLERANCE and done + 1 >= _MIN_ITERATIONS:
                break
            estimates = self._refit(
                log_focal, shape, observations, estimates, float(np.exp(focal_step))
            )
        before = self._expected.precision
        return LogFocal(log_focal, before + _PERSPECTIVE_RESPONSE**2 * (precision - before))

    def _bias_corrected(
        self, log_focal: float, estimates: Sequence[PoseAndFace]
    ) -> list[LandmarkObservation]:
        """The observations less the detector's errors in rendered pictures of the estimates.

        Its greatest error is in perspective: it places the landmarks of every face as if it were
        seen from about half a metre, which uncorrected would bias the focal length.
        """
        focal = float(np.exp(log_focal))
        return [
            self._detector.bias_corrected(observation, estimate, self._size, focal)
            for observation, estimate in zip(self._observations, estimates, strict=True)
        ]

    def _refit(
        self,
        log_focal: float,
        shape: Float[Array, " w"],
        observations: Sequence[LandmarkObservation],
        estimates: Sequence[PoseAndFace],
        distance_factor: float,
    ) -> list[PoseAndFace]:
        """Pose and face in every frame at another focal length and shape."""
        scale = np.array([1.0, 1.0, distance_factor])
        return [
            fit_face(
                self._with_shape(observation, shape),
                self._detector.layout,
                float(np.exp(log_focal)),
                initial=replace(estimate, t=estimate.t * scale),
            )
            for observation, estimate in zip(observations, estimates, strict=True)
        ]

    def _with_shape(
        self, observation: LandmarkObservation, shape: Float[Array, " w"]
    ) -> LandmarkObservation:
        """The same on a head with these coefficients of its shape error."""
        return replace(
            observation,
            positions=observation.positions + self._shape_offsets[observation.indices] @ shape,
        )

    def _system(
        self,
        log_focal: float,
        shape: Float[Array, " w"],
        observations: Sequence[LandmarkObservation],
        estimates: Sequence[PoseAndFace],
    ) -> BlockSystem:
        """Normal equations: log focal length and shape are common, the others each frame's."""
        count = len(shape)
        common, gradient = np.eye(1 + count), np.concatenate([[0.0], shape])
        common[0, 0] = self._expected.precision
        gradient[0] = self._expected.precision * (log_focal - self._expected.mean)
        blocks, coupling, block_gradients = [], [], []
        for observation, estimate in zip(observations, estimates, strict=True):
            hessian, frame_gradient = self._frame(
                self._with_shape(observation, shape), estimate, float(np.exp(log_focal))
            )
            common_mask = np.zeros(len(frame_gradient), bool)
            common_mask[[_FOCAL, *range(len(frame_gradient) - count, len(frame_gradient))]] = True
            common += hessian[np.ix_(common_mask, common_mask)]
            gradient += frame_gradient[common_mask]
            blocks.append(hessian[np.ix_(~common_mask, ~common_mask)])
            coupling.append(hessian[np.ix_(common_mask, ~common_mask)])
            block_gradients.append(frame_gradient[~common_mask])
        return BlockSystem(
            common, np.stack(blocks), np.stack(coupling), gradient, np.stack(block_gradients)
        )

    def _frame(
        self, observation: LandmarkObservation, estimate: PoseAndFace, focal_px: float
    ) -> tuple[Array, Array]:
        """Of one frame, over its camera, its face, the detector's error in it, and the shape."""
        problem = LandmarkProblem(observation, self._detector.layout, focal_px, initial=estimate)
        detector_offsets = self._detector_offsets[observation.indices]
        offsets = [observation.offsets, detector_offsets, self._shape_offsets[observation.indices]]
        hessian, gradient = problem.linearize(estimate).normal_equations(
            np.concatenate(offsets, axis=2)
        )
        face = slice(CAMERA_SIZE, CAMERA_SIZE + len(estimate.face))
        problem.add_prior(estimate.face, hessian[face, face], gradient[face])
        own = np.arange(face.stop, face.stop + detector_offsets.shape[2])
        hessian[own, own] += 1
        # A weight at its bound is fixed.
        fixed = face.start + np.flatnonzero((estimate.face <= 0) | (estimate.face >= MAX_WEIGHT))
        hessian[fixed], hessian[:, fixed], gradient[fixed] = 0, 0, 0
        hessian[fixed, fixed] = 1
        return hessian, gradient


def estimate_focal(
    frames: Iterable[UInt8[Array, "h w 3"]],
    detector: HeadDetector,
    head: Head,
    *,
    expected: LogFocal | None = None,
    is_match: Callable[[UInt8[Array, "h w 3"], HeadDetection], bool] = lambda pixels, result: True,
) -> FocalEstimate:
    """The focal length of a video from some of its first frames, every fifth, say.

    Args:
        frames: upright pictures of one size; each takes some 10 ms.
        detector: of the head.
        head: of the person in the video.
        expected: the prior; by default lens.expected_focal.
        is_match: whether a face detected in a picture is the head's.

    Raises:
        InputError: no frames.
    """
    estimator, size = None, None
    for number, pixels in enumerate(frames):
        if estimator is None:
            size = (pixels.shape[1], pixels.shape[0])
            expected = expected or expected_focal(head, *size)
            estimator = FocalEstimator(detector, head, size, expected)
        for face in detector.detect_faces(pixels):
            estimator.add(face, partial(is_match, pixels))
        if not estimator.frames_used and number % _SMALL_FACE_INTERVAL == 0:
            for face in detector.detect_small_faces(pixels):
                estimator.add(face, partial(is_match, pixels))
    if estimator is None or size is None or expected is None:
        raise InputError("frames", "at least one", "none")
    try:
        result = estimator.estimate()
    except EstimationError:
        result = expected
    return FocalEstimate(
        result.focal_px,
        result.deviation,
        estimator.frames_used,
        _note(result, expected, size, estimator.frames_used),
    )


def _note(result: LogFocal, expected: LogFocal, size: tuple[int, int], frames: int) -> str:
    angle = 2 * np.degrees(np.arctan(max(size) / 2 / result.focal_px))
    lens = f"focal length {result.focal_px:.0f} px ({angle:.0f} degrees across)"
    if result.deviation > _UNINFORMATIVE * expected.deviation:
        return f"{lens}, mostly as expected: the head moves too little to tell more"
    return f"{lens}, good to {result.deviation:.0%}, from {frames} frames"


def _shape_components() -> Float[Array, "478 3 w"]:
    """(478, 3, W) mm: identity components at the landmarks, each at one standard deviation."""
    generic = load_generic_head()
    components = at_landmarks(generic, generic.identity.components[:_SHAPE_COMPONENTS])
    return np.ascontiguousarray(components.transpose(1, 2, 0), np.float64)


def _same_view(estimate: PoseAndFace, other: PoseAndFace) -> bool:
    distance_change = abs(float(np.log(estimate.t[2] / other.t[2])))
    rotation = float(angle_between(estimate.R, other.R))
    return rotation < _NEW_VIEW_RAD and distance_change < _NEW_VIEW_LOG_DISTANCE
