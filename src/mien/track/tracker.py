"""Frame after frame: prediction, fit, and finding the face again ([Pighin 2002] sec. 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.head import Head
from mien.track.face_model import FaceModel, FaceParameters
from mien.track.image.colour_gain import ColourGain
from mien.track.image.drawing import Pose
from mien.track.landmarks.initialization import HeadDetection, HeadDetector
from mien.track.motion_model import FRAME_SECONDS, motion_prior, parameter_blocks, predict
from mien.track.parameters import Parameters
from mien.track.photometric.frame_fit import FrameFitOptions, FrameFitter, FrameSolution
from mien.track.photometric.image_jacobian import LOG_FOCAL, POSE_UNKNOWNS
from mien.track.photometric.shrinkage import shrink_step
from mien.track.state import Layout, Status, TrackedFrame, TrackState

_MIN_NCC, _MIN_SEEN = 0.6, 0.3
"""Correlation and visible fraction below which a face is lost."""
MISMATCH_RMS = 20.0
"""Grey levels of RMS error above which a face is hardly the head's. Four heads have 3 to 11 on the
median frame of clips of their people and 19.3 on the worst; on clips of other people 19.5 to 161
(docs/method/tracking.md)."""
_MAX_RMS_RATIO = 2.0
"""A face that is found anew is rejected above MISMATCH_RMS if its RMS error is more than this times
the 10th percentile of the frames before."""
_MIN_ERRORS = 5
"""Frames from which that percentile is taken, at least."""
_SEARCH_INTERVAL = 10
"""Every so many frames a mismatched face is compared with others, and small faces are searched for
in parts of the picture, which takes the time of ten detections."""


@dataclass(frozen=True)
class TrackOptions:
    """How a video is tracked.

    Attributes:
        fit: options of the fit to one frame.
        units: names of face units to track; by default blinks for a head with photographed
            expressions, and all that a front view shows for one without.
        steady: whether steps that are not significant are shrunk; off, every frame is solved by
            itself (docs/method/tracking.md).
    """

    fit: FrameFitOptions = field(default_factory=FrameFitOptions)
    units: tuple[str, ...] | None = None
    steady: bool = True


class Tracker:
    """Follows one head through a video.

    Where there are several faces, the one that looks like the head is followed.

    Attributes:
        layout: of the numbers that each frame gives.
        other_faces_seen: whether a lost frame had a face in it.

    Args:
        head: that is tracked.
        width: px, of the video's upright pictures.
        height: px, of the video's upright pictures.
        focal_px: of the video's upright pictures.
        detector: of faces and their landmarks.
        options: of the tracker.
        model: of this head and these units, made here unless given, in a second.
        head_detector: of this head and these units, made here unless given, in a second.

    Raises:
        InputError: as Rig.
    """

    def __init__(
        self,
        head: Head,
        width: int,
        height: int,
        *,
        focal_px: float,
        detector: LandmarkDetector,
        options: TrackOptions | None = None,
        model: FaceModel | None = None,
        head_detector: HeadDetector | None = None,
    ) -> None:
        options = options or TrackOptions()
        self._model = model or FaceModel(head, units=options.units)
        self._fitter = FrameFitter(self._model, options.fit)
        self.layout: Layout = self._model.layout
        self._head_detector = head_detector or HeadDetector(
            head, self.layout, detector, rig=self._model.rig
        )
        self._camera = Camera(width, height, focal_px, np.eye(3), np.array([0.0, 0.0, 1000.0]))
        self.other_faces_seen = False
        self._past: list[TrackedFrame] = []
        self._errors: list[float] = []
        self._steady = options.steady
        self._blocks = parameter_blocks(self._model)

    def resume(self, frames: Sequence[TrackedFrame]) -> None:
        """Go on as if these frames had been tracked."""
        self._past = list(frames[-2:])
        self._errors = [item.rms for item in frames if item.state is not None]
        self.other_faces_seen = False

    def step(
        self,
        pixels: UInt8[Array, "h w 3"],
        frame: int,
        time: float,
        start: HeadDetection | None = None,
    ) -> TrackedFrame:
        """Head and face in the next frame.

        Args:
            pixels: sRGB; the whole picture, in its own size or smaller.
            frame: its number.
            time: seconds.
            start: where to find the face anew; by default where the detector finds any.
        """
        camera, again = self._camera_of(pixels), frame % _SEARCH_INTERVAL == 0
        status: Status = "ok"
        fitted = self._follow(pixels, camera, time)
        if fitted is None:
            status = "reacquired" if self._past else "ok"
            small_too = again or not self._past
            fitted = self._find(pixels, camera, small_too=small_too, start=start)
        elif fitted.error.rms > MISMATCH_RMS and again:
            other = self._find(pixels, camera, small_too=True)
            if other is not None and 2 * other.error.rms < fitted.error.rms:
                status, fitted = "reacquired", other
        if fitted is not None:
            self._errors.append(fitted.error.rms)
        result = self._lost(frame, time) if fitted is None else self._tracked(fitted, frame, time)
        result = result if fitted is None else replace(result, status=status)
        self._past = [*self._past[-1:], result]
        return result

    def _camera_of(self, pixels: Array) -> Camera:
        camera = self._camera.resized(pixels.shape[1] / self._camera.width)
        return replace(camera, width=pixels.shape[1], height=pixels.shape[0])

    def _follow(self, pixels: Array, camera: Camera, time: float) -> FrameSolution | None:
        """From where it was before; None where it is not there."""
        last = self._past[-1] if self._past else None
        if last is None or last.state is None:
            return None
        parameters = predict(self._parameters(last.state), last, self._past[0], time)
        if len(self.layout.expressions) == 1:
            parameters = self._with_landmarks(parameters, pixels, camera)
        elapsed = max(time - last.time, 1e-3) / FRAME_SECONDS
        prior = motion_prior(parameters, min(np.sqrt(elapsed), 3.0))
        colour_gain = ColourGain(last.gain, last.bias)
        fitted = _if_matching(self._fitter.fit(pixels, camera, parameters, prior, colour_gain))
        return fitted if fitted is None or not self._steady else self._shrunk(fitted)

    def _with_landmarks(self, parameters: Parameters, pixels: Array, camera: Camera) -> Parameters:
        """With the face of the detector's landmarks.

        Units only deform one texture: without photographed expressions, pictures do not determine
        the opening of a mouth well enough.
        """
        state = self._head_detector.detect_near(pixels, parameters.pose.t, focal_px=camera.focal_px)
        return (
            parameters if state is None else replace(parameters, face=self._parameters(state).face)
        )

    def _shrunk(self, fitted: FrameSolution) -> FrameSolution:
        """With the step since the frame before shrunk where it is not significant."""
        before = self._past[-1].state
        assert before is not None
        start = self._parameters(before)
        step = fitted.parameters.minus(start)
        solved = np.arange(len(step)) != LOG_FOCAL
        taken = np.zeros(len(step))
        taken[solved] = shrink_step(step[solved], fitted.information, self._blocks)
        return replace(fitted, parameters=start.plus(taken))

    def _find(
        self, pixels: Array, camera: Camera, *, small_too: bool, start: HeadDetection | None = None
    ) -> FrameSolution | None:
        """By the detector, the face that matches the head best; None if there is none."""
        if start is not None:
            return self._best_match([start], pixels, camera)
        starts = self._head_detector.detect(pixels, focal_px=camera.focal_px)
        best = self._best_match(starts, pixels, camera)
        if best is None and small_too:
            small = self._head_detector.detect(pixels, focal_px=camera.focal_px, small=True)
            best, starts = self._best_match(small, pixels, camera), [*starts, *small]
        self.other_faces_seen |= bool(starts) and best is None
        return best

    def resembles(self, pixels: UInt8[Array, "h w 3"], found: HeadDetection) -> bool:
        """Whether the head matches a picture, of its own size or smaller, where it was found."""
        return self._best_match([found], pixels, self._camera_of(pixels)) is not None

    def _best_match(
        self, starts: Sequence[HeadDetection], pixels: Array, camera: Camera
    ) -> FrameSolution | None:
        """From the start that gives the best match; None where none matches."""
        fits = [(self._fit_anew(one.state, pixels, camera), one.rms_mm) for one in starts]
        sound = [(fit, _mismatch(fit, misfit)) for fit, misfit in fits if _if_matching(fit)]
        best, _ = min(sound, key=lambda pair: pair[1], default=(None, 0.0))
        return best if best and best.error.rms <= self._max_rms else None

    @property
    def _max_rms(self) -> float:
        """Grey levels, the largest RMS error of a face that is found anew."""
        if len(self._errors) < _MIN_ERRORS:
            return np.inf
        return max(MISMATCH_RMS, _MAX_RMS_RATIO * float(np.percentile(self._errors, 10)))

    def _fit_anew(self, state: TrackState, pixels: Array, camera: Camera) -> FrameSolution | None:
        parameters = self._parameters(state)
        # Twice: the detector's landmarks are some millimetres off.
        prior = motion_prior(parameters, 1.5)
        first = self._fitter.fit(pixels, camera, parameters, prior)
        if first is None:
            return None
        prior = replace(prior, mean=first.parameters)
        return self._fitter.fit(pixels, camera, first.parameters, prior, first.colour_gain)

    def _parameters(self, state: TrackState) -> Parameters:
        alpha = self._model.basis.alpha(state.weights)
        return Parameters(
            Pose(state.R_cam_head, state.t_cam_head), FaceParameters(alpha, state.units, state.gaze)
        )

    def _tracked(self, fitted: FrameSolution, frame: int, time: float) -> TrackedFrame:
        model, parameters = self._model, fitted.parameters
        weights = model.weights(parameters.face)
        state = TrackState(
            parameters.pose.R,
            parameters.pose.t,
            weights,
            parameters.face.units,
            parameters.face.gaze,
        )
        return TrackedFrame(
            frame,
            time,
            "ok",
            state,
            fitted.error.rms,
            fitted.error.seen,
            self._channel_deviations(fitted.deviations[POSE_UNKNOWNS:]),
            fitted.colour_gain.gain,
            fitted.colour_gain.bias,
        )

    def _channel_deviations(self, deviations: Array) -> Float[Array, " c"]:
        """Of the layout's channels, from those of the parameters."""
        alpha = self._model.neutral.alpha
        own = deviations[: alpha.size].reshape(alpha.shape)
        weights = np.sqrt(own**2 @ (self._model.basis.Q.T**2)).ravel()
        rest = deviations[alpha.size :]
        return np.concatenate([weights if alpha.size else np.empty(0), rest])

    def _lost(self, frame: int, time: float) -> TrackedFrame:
        unknown = np.full(len(self.layout.channels), np.nan)
        return TrackedFrame(
            frame, time, "lost", None, np.nan, 0.0, unknown, np.ones(3), np.zeros(3)
        )


def _mismatch(fitted: FrameSolution | None, rms_mm: float) -> float:
    """Lower is better. Correlation depends on the light, landmarks on the expression."""
    return np.inf if fitted is None else (1 - fitted.error.ncc) * rms_mm


def _if_matching(fitted: FrameSolution | None) -> FrameSolution | None:
    if fitted is None:
        return None
    error = fitted.error
    return fitted if error.ncc >= _MIN_NCC and error.seen >= _MIN_SEEN else None
