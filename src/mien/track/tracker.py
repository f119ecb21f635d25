"""Frame after frame: prediction, fit, and finding the face again ([Pighin 2002] sec. 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.head import Head
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.track.face_model import FaceParameters, TrackedFace
from mien.track.image.colour_gain import Colours
from mien.track.image.drawing import Pose
from mien.track.landmarks.initialization import HeadDetection, HeadDetector
from mien.track.parameters import Belief, Guess
from mien.track.photometric.frame_fit import FitOptions, Fitted, FrameFit
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.shrinkage import Block, steady_step
from mien.track.state import Layout, Status, TrackedFrame, TrackState

_POSE_DEVIATIONS = (0.1, 0.1, 0.1, 15.0, 15.0, 40.0, 0.3)
"""Rotation (rad), translation (mm), log focal length: how far a head may go in a frame."""
_WEIGHT_DEVIATION, _UNIT_DEVIATION, _GAZE_DEVIATION = 0.2, 0.25, 0.2
"""How far what the face does may go from one frame to the next; of what pictures do not tell, this
keeps the least change."""
_REST_DEVIATION = 0.4
"""How far units and gaze (rad) are from rest; what pictures do not tell goes back there."""
_CLEAR_POSE, _CLEAR_FACE = 9.0, 3.0
"""Standard deviations from which on a step is rather motion. Frames one after another err alike
and more than they say where the head is, and its trembling is seen; a small smile must show."""
_MEASURED_DEVIATION = 0.08
"""How far units and gaze (rad) lie from what the detector's landmarks say."""
_LEAST_LIKENESS, _LEAST_SEEN = 0.6, 0.3
"""Below these a face is lost: the drawn face does not look like the frame, or it is covered."""
STRANGE_RMS = 20.0
"""Grey levels by which a drawn face is off from which on it is hardly the person's. Four heads are
off by 3 to 11 on the median frame of clips of their people and by 19.3 on the worst, on other
people's clips by 19.5 to 161 (docs/method/tracking.md)."""
_UNUSUAL = 2.0
"""So many times as far off as in the best tenth of the frames before, a face that is not where it
was in the last frame is another person's, if it is strange, too."""
_ENOUGH = 5
"""Frames that tell what is usual."""
_LOOK_AROUND = 10
"""Every so many frames a strange face is compared with others, and faces are sought that are too
small to be found in the whole picture; that takes the time of ten looks."""
_USUAL_STEP = 1 / 25
"""Seconds between two frames for which these hold."""


@dataclass(frozen=True)
class TrackOptions:
    """How a video is tracked.

    Attributes:
        fit: how a frame is.
        units: names of face units to track; by default blinks for a head with photographed
            expressions, and all that a front view shows for one without.
        steady: whether steps that cannot be told from noise are taken in part only; off, every
            frame stands for itself (docs/method/tracking.md).
    """

    fit: FitOptions = field(default_factory=FitOptions)
    units: tuple[str, ...] | None = None
    steady: bool = True


class Tracker:
    """Follows one head through a video.

    Where there are several faces, the one that looks like the head is followed.

    Attributes:
        layout: of the numbers that each frame gives.
        met_others: whether in a lost frame there was a face.

    Args:
        width: of the video's upright pictures.
        height: of the video's upright pictures.
        focal_px: of the video's upright pictures.
        model: of this head and these units, if there are any already; a second each.
        head_detector: of this head and these units, if there are any already; a second each.

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
        model: TrackedFace | None = None,
        head_detector: HeadDetector | None = None,
    ) -> None:
        options = options or TrackOptions()
        self._model = model or TrackedFace(head, units=options.units)
        self._fit = FrameFit(self._model, options.fit)
        self.layout: Layout = self._model.layout
        self._head_detector = head_detector or HeadDetector(
            head, self.layout, detector, rig=self._model.rig
        )
        self._camera = Camera(width, height, focal_px, np.eye(3), np.array([0.0, 0.0, 1000.0]))
        self.met_others = False
        self._past: list[TrackedFrame] = []
        self._errors: list[float] = []
        self._steady = options.steady
        self._blocks = _blocks(self._model)

    def resume(self, frames: Sequence[TrackedFrame]) -> None:
        """Go on as if these frames had been tracked."""
        self._past = list(frames[-2:])
        self._errors = [item.rms for item in frames if item.state is not None]
        self.met_others = False

    def step(
        self,
        pixels: UInt8[Array, "h w 3"],
        frame: int,
        time: float,
        start: HeadDetection | None = None,
    ) -> TrackedFrame:
        """What the next frame shows.

        Args:
            pixels: sRGB; the whole picture, in its own size or smaller.
            frame: its number.
            time: seconds.
            start: where a face that is found anew is; by default where the detector finds any.
        """
        camera, again = self._camera_of(pixels), frame % _LOOK_AROUND == 0
        status: Status = "ok"
        fitted = self._followed(pixels, camera, time)
        if fitted is None:
            status = "reacquired" if self._past else "ok"
            closely = again or not self._past
            fitted = self._found(pixels, camera, closely=closely, start=start)
        elif fitted.agreement.rms > STRANGE_RMS and again:
            other = self._found(pixels, camera, closely=True)
            if other is not None and 2 * other.agreement.rms < fitted.agreement.rms:
                status, fitted = "reacquired", other
        if fitted is not None:
            self._errors.append(fitted.agreement.rms)
        result = self._lost(frame, time) if fitted is None else self._shown(fitted, frame, time)
        result = result if fitted is None else replace(result, status=status)
        self._past = [*self._past[-1:], result]
        return result

    def _camera_of(self, pixels: Array) -> Camera:
        camera = self._camera.resized(pixels.shape[1] / self._camera.width)
        return replace(camera, width=pixels.shape[1], height=pixels.shape[0])

    def _followed(self, pixels: Array, camera: Camera, time: float) -> Fitted | None:
        """From where it was before; None where it is not there."""
        if not self._past or self._past[-1].state is None:
            return None
        guess = self._predicted(time)
        if len(self.layout.expressions) == 1:
            guess = self._with_landmarks(guess, pixels, camera)
        elapsed = max(time - self._past[-1].time, 1e-3) / _USUAL_STEP
        belief = self._belief(guess, min(np.sqrt(elapsed), 3.0))
        colours = Colours(self._past[-1].gain, self._past[-1].bias)
        fitted = _if_like(self._fit.fit(pixels, camera, guess, belief, colours))
        return fitted if fitted is None or not self._steady else self._steadied(fitted)

    def _with_landmarks(self, guess: Guess, pixels: Array, camera: Camera) -> Guess:
        """The face as the detector's landmarks have it.

        Units move one texture about: of a mouth that was never photographed open, the picture says
        too little.
        """
        state = self._head_detector.detect_near(pixels, guess.pose.t, focal_px=camera.focal_px)
        return guess if state is None else replace(guess, face=self._guess(state).face)

    def _steadied(self, fitted: Fitted) -> Fitted:
        """With no more motion since the frame before than can be told from noise."""
        before = self._past[-1].state
        assert before is not None
        start = self._guess(before)
        step = fitted.guess.since(start)
        solved = np.arange(len(step)) != POSE_UNKNOWNS - 1
        taken = np.zeros(len(step))
        taken[solved] = steady_step(step[solved], fitted.information, self._blocks)
        return replace(fitted, guess=start.moved(taken))

    def _found(
        self, pixels: Array, camera: Camera, *, closely: bool, start: HeadDetection | None = None
    ) -> Fitted | None:
        """By the detector, the face most like the head; None where there is none, or another's."""
        if start is not None:
            return self._likest([start], pixels, camera)
        starts = self._head_detector.detect(pixels, focal_px=camera.focal_px)
        best = self._likest(starts, pixels, camera)
        if best is None and closely:
            small = self._head_detector.detect(pixels, focal_px=camera.focal_px, small=True)
            best, starts = self._likest(small, pixels, camera), [*starts, *small]
        self.met_others |= bool(starts) and best is None
        return best

    def resembles(self, pixels: UInt8[Array, "h w 3"], found: HeadDetection) -> bool:
        """Whether the head looks like a picture, its own size or smaller, in the place found."""
        return self._likest([found], pixels, self._camera_of(pixels)) is not None

    def _likest(
        self, starts: Sequence[HeadDetection], pixels: Array, camera: Camera
    ) -> Fitted | None:
        """From the start that gives the face most like the head; None where none is like it."""
        fits = [(self._fitted_anew(one.state, pixels, camera), one.rms_mm) for one in starts]
        sound = [(fit, _unlike(fit, misfit)) for fit, misfit in fits if _if_like(fit)]
        best, _ = min(sound, key=lambda pair: pair[1], default=(None, 0.0))
        return best if best and best.agreement.rms <= self._most_usual else None

    @property
    def _most_usual(self) -> float:
        """Grey levels by which a face that was found anew may be off."""
        if len(self._errors) < _ENOUGH:
            return np.inf
        return max(STRANGE_RMS, _UNUSUAL * float(np.percentile(self._errors, 10)))

    def _fitted_anew(self, state: TrackState, pixels: Array, camera: Camera) -> Fitted | None:
        guess = self._guess(state)
        # Twice: the detector's landmarks are some millimetres off.
        belief = self._belief(guess, 1.5)
        first = self._fit.fit(pixels, camera, guess, belief)
        if first is None:
            return None
        belief = replace(belief, mean=first.guess)
        return self._fit.fit(pixels, camera, first.guess, belief, first.colours)

    def _belief(self, guess: Guess, factor: float) -> Belief:
        """Around a guess; the factor widens it. Units and gaze tend to rest."""
        mixing, units = guess.face.alpha.size, len(guess.face.units)
        if not mixing:
            deviations = np.array([*_POSE_DEVIATIONS, *[_MEASURED_DEVIATION] * (units + 2)])
            return Belief(guess, deviations)
        usual = [_WEIGHT_DEVIATION] * mixing + [_UNIT_DEVIATION] * units + [_GAZE_DEVIATION] * 2
        deviations = factor * np.array([*_POSE_DEVIATIONS, *usual])
        resting = np.s_[len(_POSE_DEVIATIONS) + mixing :]
        stays = 1 / (1 + (deviations[resting] / _REST_DEVIATION) ** 2)
        deviations[resting] *= np.sqrt(stays)
        tending, gaze = stays[:-2] * guess.face.units, stays[-2:] * guess.face.gaze
        face = replace(guess.face, units=tending, gaze=gaze)
        return Belief(replace(guess, face=face), deviations)

    def _guess(self, state: TrackState) -> Guess:
        alpha = self._model.basis.alpha(state.weights)
        return Guess(
            Pose(state.R_cam_head, state.t_cam_head), FaceParameters(alpha, state.units, state.gaze)
        )

    def _predicted(self, time: float) -> Guess:
        """Linearly from two frames ([Pighin 2002] sec. 6.2), the pose; what the face does stays."""
        last = self._past[-1]
        assert last.state is not None
        guess = self._guess(last.state)
        before = self._past[0]
        # From another person's face to the head's own is no motion.
        if len(self._past) < 2 or before.state is None or last.status == "reacquired":
            return guess
        ahead = (time - last.time) / max(last.time - before.time, 1e-3)
        ahead = float(np.clip(ahead, 0, 2))
        turn = rotation_to_vector(last.state.R_cam_head @ before.state.R_cam_head.T)
        shift = last.state.t_cam_head - before.state.t_cam_head
        rotation = rotation_from_vector(ahead * turn) @ guess.pose.R
        return replace(guess, pose=Pose(rotation, guess.pose.t + ahead * shift))

    def _shown(self, fitted: Fitted, frame: int, time: float) -> TrackedFrame:
        model, guess = self._model, fitted.guess
        weights = model.weights(guess.face)
        state = TrackState(guess.pose.R, guess.pose.t, weights, guess.face.units, guess.face.gaze)
        return TrackedFrame(
            frame,
            time,
            "ok",
            state,
            fitted.agreement.rms,
            fitted.agreement.seen,
            self._channel_deviations(fitted.deviations[POSE_UNKNOWNS:]),
            fitted.colours.gain,
            fitted.colours.bias,
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


def _unlike(fitted: Fitted | None, misfit_mm: float) -> float:
    """How far a face is from looking like the head and having its shape: in other light the first

    tells less, in other expressions the second.
    """
    return np.inf if fitted is None else (1 - fitted.agreement.likeness) * misfit_mm


def _if_like(fitted: Fitted | None) -> Fitted | None:
    if fitted is None:
        return None
    alike, seen = fitted.agreement.likeness, fitted.agreement.seen
    return fitted if alike >= _LEAST_LIKENESS and seen >= _LEAST_SEEN else None


def _blocks(model: TrackedFace) -> list[Block]:
    """Of the unknowns without the focal length: the pose, each region, units, gaze."""
    alpha, units = model.neutral.alpha, len(model.layout.units)
    pose = np.delete(_POSE_DEVIATIONS, POSE_UNKNOWNS - 1)
    regions = [np.full(alpha.shape[1], _WEIGHT_DEVIATION)] * len(alpha)
    face = [*regions, np.full(units, _UNIT_DEVIATION), np.full(2, _GAZE_DEVIATION)]
    ends = np.cumsum([len(pose), *map(len, face)])
    blocks = [Block(np.arange(len(pose)), pose, _CLEAR_POSE)]
    for end, usual in zip(ends[1:], face, strict=True):
        blocks.append(Block(np.arange(end - len(usual), end), usual, _CLEAR_FACE))
    return blocks
