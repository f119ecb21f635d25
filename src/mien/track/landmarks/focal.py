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
from mien.track.landmarks.fit import MOST, Guess, MarkProblem, Observation, fit_face
from mien.track.landmarks.initialization import Found, Starter
from mien.track.landmarks.model import REPEATED_MM
from mien.track.lens import LogFocal, expected_focal

MOST_FRAMES = 8
"""More add little."""
_OTHERWISE_RAD, _OTHERWISE_NEAR = np.radians(5.0), 0.08
"""A frame tells something new when its head is turned by this much or as much (in log distance)
nearer than in all that were used: landmarks err alike where heads are seen alike."""
_WAYS = 24
"""Of heads to differ, the greatest first: landmarks are off in ways that look like a shape."""
_SHOWN = 0.65
"""Of a change of perspective, the detector's landmarks follow this share. The estimate is right all
the same, for pictures of the head tell as much; but it is known less well by so much."""
_LEAST_ROUNDS, _MOST_ROUNDS, _SETTLED, _FARTHEST = 3, 8, 0.01, 0.5
_CLOSELY = 5
"""Every so many frames that show no face of the head's, faces are sought that are too small to be
found in the whole picture."""
_FOCAL = CAMERA_SIZE - 1
_LITTLE = 0.7


@dataclass(frozen=True)
class FocalEstimate:
    """A video's focal length.

    Attributes:
        focal_px: of its upright pictures.
        deviation: of its logarithm; 0.1 is about 10 %.
        frames_used: how many frames it rests on.
        note: one line for the user.
    """

    focal_px: float
    deviation: float
    frames_used: int
    note: str


class FocalEstimator:
    """Gathers frames whose heads are seen differently, and weighs what they say together.

    Unknown in common are the focal length and how far the head's shape is off; in every frame the
    pose, what the face does, and how far the detector is off there. So a head that holds still
    says little, however long it does.

    Args:
        starter: of the head.
        size: width and height of the video's upright pictures.
        expected: what is known before; see lens.expected_focal.
    """

    def __init__(
        self, starter: Starter, head: Head, size: tuple[int, int], expected: LogFocal
    ) -> None:
        self._starter, self._size, self._expected = starter, size, expected
        ways = _ways_to_be_off()
        spread = float(np.sqrt((ways**2).sum(axis=(1, 2)).mean()))
        corners = load_generic_head().mesh.triangles[load_generic_head().landmark_triangles]
        unsure = float(np.median(head.uncertainty_mm[corners]))
        # Of the shape, and of the detector in a frame.
        self._off_in_common = ways * (unsure / spread)
        self._off_in_frame = ways * (np.sqrt(2) * REPEATED_MM / spread)
        self._seen: list[Observation] = []
        self._guesses: list[Guess] = []
        self._others: list[Guess] = []

    @property
    def frames_used(self) -> int:
        """How many frames are kept."""
        return len(self._seen)

    def add(self, face: DetectedFace, is_own: Callable[[Found], bool] = lambda found: True) -> bool:
        """Keep a face, in px of the upright picture, if no other was seen as it is.

        Args:
            is_own: whether the face, which is found there, is the head's.
        """
        if self.frames_used == MOST_FRAMES:
            return False
        seen = Observation.of(self._starter.marks, face, self._size)
        focal = self._expected.focal_px
        try:
            guess = fit_face(seen, self._starter.layout, focal, start=seen.start(focal))
        except EstimationError:
            return False
        if any(_alike(guess, other) for other in (*self._guesses, *self._others)):
            return False
        found = self._starter.fit(face, size=self._size, focal_px=focal)
        if found is None or not is_own(found):
            self._others.append(guess)
            return False
        self._seen.append(seen)
        self._guesses.append(guess)
        return True

    def estimate(self) -> LogFocal:
        """The focal length of highest posterior, and how well it is known.

        Raises:
            EstimationError: a landmark comes to lie behind the camera.
        """
        if not self._seen:
            return self._expected
        now, off = self._expected.mean, np.zeros(self._off_in_common.shape[2])
        guesses, precision = self._guesses, self._expected.precision
        for done in range(_MOST_ROUNDS):
            seen = self._corrected(now, guesses)
            system = self._system(now, off, seen, guesses)
            precision = 1 / float(system.covariance()[0][0, 0])
            step = system.solve(0.0)[0]
            ahead = float(np.clip(step[0], -_FARTHEST, _FARTHEST))
            now, off = now + ahead, off + step[1:]
            if abs(ahead) < _SETTLED and done + 1 >= _LEAST_ROUNDS:
                break
            guesses = self._refitted(now, off, seen, guesses, float(np.exp(ahead)))
        before = self._expected.precision
        return LogFocal(now, before + _SHOWN**2 * (precision - before))

    def _corrected(self, log_focal: float, guesses: Sequence[Guess]) -> list[Observation]:
        """What was seen, less what the detector errs by when it is shown the guesses.

        Perspective is what it errs about most: it draws all faces as if seen from half a metre or
        so, and without this they would all seem to be.
        """
        focal = float(np.exp(log_focal))
        return [
            self._starter.corrected(seen, guess, self._size, focal)
            for seen, guess in zip(self._seen, guesses, strict=True)
        ]

    def _refitted(
        self,
        log_focal: float,
        off: Float[Array, " w"],
        observations: Sequence[Observation],
        guesses: Sequence[Guess],
        nearer: float,
    ) -> list[Guess]:
        """Pose and face in every frame for another focal length and shape."""
        scale = np.array([1.0, 1.0, nearer])
        return [
            fit_face(
                self._shifted(seen, off),
                self._starter.layout,
                float(np.exp(log_focal)),
                start=replace(guess, t=guess.t * scale),
            )
            for seen, guess in zip(observations, guesses, strict=True)
        ]

    def _shifted(self, seen: Observation, off: Float[Array, " w"]) -> Observation:
        """The same of a head whose landmarks are off like this."""
        return replace(seen, places=seen.places + self._off_in_common[seen.kept] @ off)

    def _system(
        self,
        log_focal: float,
        off: Float[Array, " w"],
        observations: Sequence[Observation],
        guesses: Sequence[Guess],
    ) -> BlockSystem:
        """Normal equations: in common log focal length and shape, in each frame the rest."""
        ways = len(off)
        common, gradient = np.eye(1 + ways), np.concatenate([[0.0], off])
        common[0, 0] = self._expected.precision
        gradient[0] = self._expected.precision * (log_focal - self._expected.mean)
        blocks, coupling, block_gradients = [], [], []
        for seen, guess in zip(observations, guesses, strict=True):
            hessian, slope = self._frame(self._shifted(seen, off), guess, float(np.exp(log_focal)))
            shared = np.zeros(len(slope), bool)
            shared[[_FOCAL, *range(len(slope) - ways, len(slope))]] = True
            common += hessian[np.ix_(shared, shared)]
            gradient += slope[shared]
            blocks.append(hessian[np.ix_(~shared, ~shared)])
            coupling.append(hessian[np.ix_(shared, ~shared)])
            block_gradients.append(slope[~shared])
        return BlockSystem(
            common, np.stack(blocks), np.stack(coupling), gradient, np.stack(block_gradients)
        )

    def _frame(self, seen: Observation, guess: Guess, focal_px: float) -> tuple[Array, Array]:
        """Of one frame, over its camera, its face, what is off in it, and in common."""
        problem = MarkProblem(seen, self._starter.layout, focal_px, near=guess)
        off_in_frame = self._off_in_frame[seen.kept]
        moves = [seen.moves, off_in_frame, self._off_in_common[seen.kept]]
        hessian, gradient = problem.measured(guess).normal_equations(np.concatenate(moves, axis=2))
        face = slice(CAMERA_SIZE, CAMERA_SIZE + len(guess.face))
        problem.add_belief(guess.face, hessian[face, face], gradient[face])
        own = np.arange(face.stop, face.stop + off_in_frame.shape[2])
        hessian[own, own] += 1
        # A weight at its bound stays there.
        held = face.start + np.flatnonzero((guess.face <= 0) | (guess.face >= MOST))
        hessian[held], hessian[:, held], gradient[held] = 0, 0, 0
        hessian[held, held] = 1
        return hessian, gradient


def estimate_focal(
    frames: Iterable[UInt8[Array, "h w 3"]],
    starter: Starter,
    head: Head,
    *,
    expected: LogFocal | None = None,
    is_own: Callable[[UInt8[Array, "h w 3"], Found], bool] = lambda pixels, found: True,
) -> FocalEstimate:
    """The focal length of a video from some of its first frames, every fifth, say.

    Args:
        frames: upright pictures of one size, at most as many as are worth 10 ms each.
        expected: what is known before; by default lens.expected_focal.
        is_own: whether a face found in a picture is the head's.

    Raises:
        InputError: no frames.
    """
    estimator, size = None, None
    for number, pixels in enumerate(frames):
        if estimator is None:
            size = (pixels.shape[1], pixels.shape[0])
            expected = expected or expected_focal(head, *size)
            estimator = FocalEstimator(starter, head, size, expected)
        for face in starter.look(pixels):
            estimator.add(face, partial(is_own, pixels))
        if not estimator.frames_used and number % _CLOSELY == 0:
            for face in starter.look_closely(pixels):
                estimator.add(face, partial(is_own, pixels))
    if estimator is None or size is None or expected is None:
        raise InputError("frames", "at least one", "none")
    try:
        found = estimator.estimate()
    except EstimationError:
        found = expected
    return FocalEstimate(
        found.focal_px,
        found.deviation,
        estimator.frames_used,
        _note(found, expected, size, estimator.frames_used),
    )


def _note(found: LogFocal, expected: LogFocal, size: tuple[int, int], frames: int) -> str:
    angle = 2 * np.degrees(np.arctan(max(size) / 2 / found.focal_px))
    lens = f"focal length {found.focal_px:.0f} px ({angle:.0f} degrees across)"
    if found.deviation > _LITTLE * expected.deviation:
        return f"{lens}, mostly as expected: the head moves too little to tell more"
    return f"{lens}, good to {found.deviation:.0%}, from {frames} frames"


def _ways_to_be_off() -> Float[Array, "478 3 w"]:
    """(478, 3, W) mm: landmarks of heads that differ, each at one standard deviation."""
    generic = load_generic_head()
    components = at_landmarks(generic, generic.identity.components[:_WAYS])
    return np.ascontiguousarray(components.transpose(1, 2, 0), np.float64)


def _alike(guess: Guess, other: Guess) -> bool:
    nearer = abs(float(np.log(guess.t[2] / other.t[2])))
    turned = float(angle_between(guess.R, other.R))
    return turned < _OTHERWISE_RAD and nearer < _OTHERWISE_NEAR
