"""Landmarks of a head that is known, as a detector without error would find them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import posable
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES, DetectedFace
from mien.head import Head
from mien.numeric.rotation import rotation_from_vector
from mien.track.landmarks.initialization import HeadDetector
from mien.track.state import Layout, TrackState

SIZE, FOCAL = (640, 480), 800.0
FRONT = np.diag([1.0, -1.0, -1.0])
LAYOUT = Layout(("mouth", "eyes", "forehead"), posable.NAMES, ("eyeBlinkLeft", "eyeBlinkRight"))


class Blind(LandmarkDetector):
    """Sees nothing: landmarks stay where the generic head has them."""

    def __init__(self) -> None:
        pass

    def detect_all_fast(self, pixels: Array) -> list[DetectedFace]:
        return []

    def detect_in_tiles(self, pixels: Array) -> list[DetectedFace]:
        return []


class Shown(Blind):
    """Sees the faces that it is told, one after the other."""

    def __init__(self, *faces: DetectedFace | None) -> None:
        self.faces = list(faces)
        self.sizes: list[tuple[int, ...]] = []

    def detect_all_fast(self, pixels: Array) -> list[DetectedFace]:
        self.sizes.append(pixels.shape[1::-1])
        face = self.faces.pop(0)
        return [] if face is None else [face]


def prepared(head: Head, layout: Layout) -> HeadDetector:
    """One whose detector errs by a millimetre and scores a unit of the layout by its weight."""
    one = HeadDetector(head, layout, Blind())
    sigma = np.where(np.isfinite(one.model.sigma_mm), 1.0, np.inf)
    score_offsets = np.zeros_like(one.model.score_offsets)
    for row, name in enumerate(layout.units, len(score_offsets) - len(layout.units)):
        score_offsets[row, BLENDSHAPE_NAMES.index(name)] = 1.0
    one.model = replace(one.model, score_offsets=score_offsets, sigma_mm=sigma)
    return one


@cache
def head_detector() -> HeadDetector:
    """Of the head as usual."""
    return prepared(posable.head(), LAYOUT)


def posed(degrees: tuple[float, float, float] = (5, -12, 4), **changes: Array) -> TrackState:
    """A head turned like this (about the camera's x, y and z), making no face."""
    weights = np.zeros((3, 4))
    weights[:, 0] = 1
    fields = {
        "R_cam_head": rotation_from_vector(np.radians(degrees)) @ FRONT,
        "t_cam_head": np.array([30.0, -20.0, 600.0]),
        "weights": weights,
        "units": np.zeros(2),
        "gaze": np.zeros(2),
    }
    return TrackState(**(fields | changes))


def face_of(
    state: TrackState, *, noise: Array | float = 0.0, of: HeadDetector | None = None
) -> DetectedFace:
    """What a detector without error, but one of 8 degrees in rotation, says of it."""
    model = (of or head_detector()).model
    unknowns = np.concatenate([state.weights[:, 1:].ravel(), state.units])
    camera = Camera(*SIZE, FOCAL, state.R_cam_head, state.t_cam_head)
    points = camera.project(model.positions + np.tensordot(unknowns, model.offsets, axes=1)) + noise
    wrong = rotation_from_vector(np.radians([4.0, -6.0, 3.0])) @ state.R_cam_head
    scores = model.scores + unknowns @ model.score_offsets
    return DetectedFace(np.column_stack([points, np.zeros(len(points))]), scores, wrong)
