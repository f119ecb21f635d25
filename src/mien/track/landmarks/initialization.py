"""The first frame: head and face found anew, from the landmark detector alone."""

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
from mien.rig.followers import part_vertices
from mien.rig.gaze import SIDES
from mien.rig.rig import Rig
from mien.track.landmarks.detector_bias import Pictures
from mien.track.landmarks.fit import Guess, Observation, fit_face
from mien.track.landmarks.model import measure_marks
from mien.track.state import Layout, TrackState

_MOST_WEIGHT = 1.5
_REACH_MM = 200.0
"""Around a head's origin, what is looked at where its face is not seen in the whole picture."""
_IRISES = [LEFT_IRIS, RIGHT_IRIS]
_LIDS = np.array([[386, 374], [159, 145]])
"""Landmarks in the middle of the upper and the lower lid, of the left and the right eye."""
_SHUT, _OPEN = 0.25, 0.6
"""Of the neutral gap between the lids: below the first an iris is guessed, from the second seen."""


class Found(NamedTuple):
    """A head in the place of a face.

    Attributes:
        state: where it is, and what it does.
        misfit_mm: how far the face's landmarks are off the head's, RMS.
    """

    state: TrackState
    misfit_mm: float


class Starter:
    """Finds one head in pictures of any size; what they share is prepared once, in a second.

    Attributes:
        marks: the landmarks of this head.
        layout: of what is found.

    Args:
        rig: of the head, if there is one already.

    Raises:
        InputError: as Rig; a layout that is not the head's.
    """

    def __init__(
        self, head: Head, layout: Layout, detector: LandmarkDetector, *, rig: Rig | None = None
    ) -> None:
        rig = Rig(head) if rig is None else rig
        self.layout, self._detector = layout, detector
        self._pictures = Pictures(rig, head.mesh, detector)
        self.marks = measure_marks(rig, head.mesh, layout, self._pictures)
        self._eyes = _Eyes(head, rig, layout, self.marks.places)

    def find(
        self, pixels: UInt8[Array, "h w 3"], *, focal_px: float, small: bool = False
    ) -> list[Found]:
        """The head in the place of every face that it fits, the largest face first.

        Args:
            focal_px: of the picture as it is given.
            small: only those that are seen in parts of the picture alone.
        """
        size = (pixels.shape[1], pixels.shape[0])
        faces = self.look_closely(pixels) if small else self.look(pixels)
        fits = (self.fit(face, size=size, focal_px=focal_px) for face in faces)
        return [found for found in fits if found is not None]

    def find_at(
        self, pixels: UInt8[Array, "h w 3"], t_cam_head: Float[Array, " 3"], *, focal_px: float
    ) -> TrackState | None:
        """The head in the face that is where it is expected, whoever else is in the picture.

        None where no face is, or none that fits.

        Args:
            t_cam_head: mm, about where the head is.
        """
        size = (pixels.shape[1], pixels.shape[0])
        x, y = focal_px * t_cam_head[:2] / t_cam_head[2] + np.array(size) / 2
        reach = focal_px * _REACH_MM / t_cam_head[2]
        faces = self._detector.detect_all_fast(pixels)
        near = [face for face in faces if _off(face, (x, y)) < face.width]
        # A small one may not be seen in the whole picture.
        near = near or detect_around(self._detector, pixels, (x, y), reach)
        if not near:
            return None
        face = min(near, key=lambda face: _off(face, (x, y)))
        found = self.fit(
            refine_small_face(self._detector, pixels, face), size=size, focal_px=focal_px
        )
        return found and found.state

    def look(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Every face, the largest first; those that are small are looked at twice."""
        faces = self._detector.detect_all_fast(pixels)
        return [refine_small_face(self._detector, pixels, face) for face in faces]

    def look_closely(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Those faces that are too small to be found in the whole picture, 70 ms."""
        large = self._detector.detect_all_fast(pixels)
        return [
            refine_small_face(self._detector, pixels, face)
            for face in self._detector.detect_in_tiles(pixels)
            if not any(is_same_face(face, other) for other in large)
        ]

    def fit(self, face: DetectedFace, *, size: tuple[int, int], focal_px: float) -> Found | None:
        """The head where a detected face is, in a picture of this width and height."""
        seen = Observation.of(self.marks, face, size)
        try:
            guess = fit_face(seen, self.layout, focal_px, start=seen.start(focal_px))
        except EstimationError:
            return None
        return Found(self._state(guess, face, size, focal_px), seen.misfit_mm(guess, focal_px))

    def corrected(
        self, seen: Observation, guess: Guess, size: tuple[int, int], focal_px: float
    ) -> Observation:
        """What was seen, less what the detector errs by in a picture of just this guess, 15 ms.

        Unchanged where it finds no face in that.
        """
        camera = Camera(*size, focal_px, guess.R, guess.t)
        weights, units = self._weights(guess.face)
        state = TrackState(guess.R, guess.t, weights, units, np.zeros(2)).face(self.layout)
        shown = self._pictures.show(state, camera)
        return seen if shown is None else seen.against(shown, guess, size, focal_px)

    def _state(
        self, guess: Guess, face: DetectedFace, size: tuple[int, int], focal_px: float
    ) -> TrackState:
        camera = Camera(*size, focal_px, guess.R, guess.t)
        weights, units = self._weights(guess.face)
        gaze = self._eyes.gaze(camera, face.points[:, :2], weights)
        return TrackState(guess.R, guess.t, weights, units, gaze)

    def _weights(self, face: Float[Array, " p"]) -> tuple[Array, Array]:
        """(R, K) blending weights, neutral first, and (U,) of units."""
        regions, expressions = len(self.layout.regions), len(self.layout.expressions) - 1
        mixed = face[: regions * expressions].reshape(regions, expressions)
        together = mixed.sum(axis=1, keepdims=True)
        mixed = mixed * np.minimum(1, _MOST_WEIGHT / np.maximum(together, 1e-9))
        weights = np.column_stack([1 - mixed.sum(axis=1), mixed])
        return weights, face[regions * expressions :]


def _off(face: DetectedFace, place: tuple[float, float]) -> float:
    """Px from between a face's eyes."""
    return float(np.linalg.norm(face.points[_IRISES, :2].mean(axis=0) - place))


class _Eyes:
    """The eyes of one head, and where the detector sees their irises in its neutral face."""

    def __init__(self, head: Head, rig: Rig, layout: Layout, places: Float[Array, "478 3"]) -> None:
        generic = load_generic_head()
        balls = [part_vertices(generic, f"{side}_eyeball") for side in SIDES]
        self._centres = np.array([head.mesh.vertices[ball].mean(axis=0) for ball in balls])
        ahead = places[_IRISES] - self._centres
        self._radii = np.linalg.norm(ahead, axis=1)
        self._ahead = yaw_pitch_from_directions(ahead / self._radii[:, None])
        self._lids = places[_LIDS]
        masks = np.stack([rig.mask(region) for region in layout.regions])
        self._obeys = np.stack([masks[:, ball[0]] for ball in balls])
        expressed = [head.expressions[name].gaze for name in layout.expressions]
        self._expressed = np.stack(expressed, axis=1)

    def gaze(
        self, camera: Camera, points: Float[Array, "478 2"], weights: Float[Array, "r k"]
    ) -> Float[Array, " 2"]:
        """(2,) rad, yaw and pitch beyond those of the expressions; 0 where both eyes are shut."""
        directions = np.stack(
            [
                direction_to_iris(camera, points[iris], centre, radius)
                for iris, centre, radius in zip(
                    _IRISES, self._centres, self._radii.tolist(), strict=True
                )
            ]
        )
        own = np.einsum("er,rk,ekc->ec", self._obeys, weights, self._expressed)
        angles = yaw_pitch_from_directions(directions) - self._ahead - own
        gaze: Array = self._openness(camera, points) @ angles
        return np.clip(gaze, -MAX_GAZE_RAD, MAX_GAZE_RAD)

    def _openness(self, camera: Camera, points: Float[Array, "478 2"]) -> Float[Array, " 2"]:
        """(2,) what either eye says, together at most 1: nothing once it is nearly shut."""
        gaps = np.linalg.norm(np.diff(points[_LIDS], axis=1)[:, 0], axis=1)
        usual = np.diff(camera.project(self._lids.reshape(-1, 3)).reshape(2, 2, 2), axis=1)[:, 0]
        open_share = gaps / np.maximum(np.linalg.norm(usual, axis=1), 1e-9)
        trust = np.clip((open_share - _SHUT) / (_OPEN - _SHUT), 0, 1)
        return trust / max(float(trust.sum()), 1.0)
