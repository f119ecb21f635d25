"""The focal length from landmarks of a head that moves, holds still, or has another shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import posable
from marked import FRONT, SIZE, Shown, head_detector
from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.errors import InputError
from mien.numeric.rotation import rotation_from_vector
from mien.track.landmarks.detector_bias import at_landmarks
from mien.track.landmarks.focal import MAX_FOCAL_FRAMES, FocalEstimator, estimate_focal
from mien.track.lens import LogFocal

DIAGONAL = float(np.hypot(*SIZE))
TRUTH = 0.9 * DIAGONAL
HOUSE = LogFocal(float(np.log(1.7 * DIAGONAL)), 0.6**-2)
SAME = LogFocal(float(np.log(1.1 * DIAGONAL)), 0.15**-2)
HEAD = replace(posable.head(), uncertainty_mm=np.full(len(posable.REST), 2.0))
PICTURE = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
Place = tuple[tuple[float, float], float]
"""Pitch and yaw in degrees, and distance in mm."""

TURNING: list[Place] = [
    ((8 * np.sin(3 * angle), 30 * np.sin(2 * angle)), 500.0) for angle in np.linspace(0, 3, 14)
]
NEARING: list[Place] = [((2.0, 4.0), distance) for distance in np.geomspace(350, 900, 12)]
STILL: list[Place] = [((np.sin(frame), np.cos(frame)), 500.0) for frame in range(12)]


def faces(
    places: Sequence[Place], rng: np.random.Generator, *, off_mm: float = 0.0, noise_mm: float = 0.0
) -> list[DetectedFace]:
    """Detections of a head in these poses; its shape has an error drawn from the identity basis."""
    model, generic = head_detector().model, load_generic_head()
    ways = at_landmarks(generic, generic.identity.components)
    usual = np.sqrt((ways**2).sum(axis=(0, 2)).mean())
    off = np.tensordot(rng.normal(size=len(ways)), ways, axes=1) * (off_mm / usual)
    return [_face(model.positions + off, place, rng, noise_mm) for place in places]


def _face(places: Array, place: Place, rng: np.random.Generator, noise_mm: float) -> DetectedFace:
    (pitch, yaw), distance = place
    turned = rotation_from_vector(np.radians([pitch, yaw, 0.0])) @ FRONT
    camera = Camera(*SIZE, TRUTH, turned, np.array([5.0, 0.0, distance]))
    noise = rng.normal(size=(len(places), 2)) * noise_mm * TRUTH / distance
    points = np.column_stack([camera.project(places) + noise, np.zeros(len(places))])
    wrong = rotation_from_vector(np.radians([3.0, -4.0, 2.0])) @ turned
    return DetectedFace(points, head_detector().model.scores, wrong)


def estimate(seen: Sequence[DetectedFace], expected: LogFocal) -> tuple[LogFocal, int]:
    estimator = FocalEstimator(head_detector(), HEAD, SIZE, expected)
    for face in seen:
        estimator.add(face)
    return estimator.estimate(), estimator.frames_used


@pytest.mark.parametrize("places", [TURNING, NEARING], ids=["turning", "nearing"])
def test_a_moving_head_determines_the_focal_length(
    places: list[Place], rng: np.random.Generator
) -> None:
    found, frames = estimate(faces(places, rng), HOUSE)
    assert found.focal_px == pytest.approx(TRUTH, rel=0.02)
    assert found.deviation < 0.16
    assert frames > 6


@pytest.mark.parametrize("places", [TURNING, NEARING], ids=["turning", "nearing"])
def test_shape_and_landmark_errors_stay_within_the_stated_deviation(
    places: list[Place], rng: np.random.Generator
) -> None:
    for _ in range(3):
        found, _ = estimate(faces(places, rng, off_mm=2.0, noise_mm=0.8), HOUSE)
        assert abs(found.mean - np.log(TRUTH)) < 2.5 * found.deviation
        assert found.focal_px == pytest.approx(TRUTH, rel=0.2)


def test_a_still_head_leaves_the_prior(rng: np.random.Generator) -> None:
    found, frames = estimate(faces(STILL, rng, off_mm=2.0, noise_mm=0.8), SAME)
    assert frames == 1
    assert found.focal_px == pytest.approx(SAME.focal_px, rel=0.1)
    assert found.deviation > 0.8 * SAME.deviation


def test_frames_of_similar_views_add_nothing(rng: np.random.Generator) -> None:
    seen = faces(TURNING, rng)
    once, twice = estimate(seen, HOUSE), estimate([*seen, *seen, *seen], HOUSE)
    assert once == twice
    assert once[1] <= MAX_FOCAL_FRAMES


def test_no_faces_leave_the_prior() -> None:
    assert estimate([], HOUSE) == (HOUSE, 0)


def test_video_with_frames_without_a_face(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(head_detector(), "_detector", Shown(*faces(TURNING, rng), None, None))
    found = estimate_focal([PICTURE] * (len(TURNING) + 2), head_detector(), HEAD, expected=HOUSE)
    assert found.focal_px == pytest.approx(TRUTH, rel=0.02)
    assert found.frames_used > 6
    assert f"focal length {found.focal_px:.0f} px" in found.note
    assert f"from {found.frames_used} frames" in found.note


def test_video_without_a_face_keeps_the_prior() -> None:
    found = estimate_focal([PICTURE] * 3, head_detector(), HEAD)
    assert found.focal_px == pytest.approx(HOUSE.focal_px)
    assert found.frames_used == 0
    assert "mostly as expected" in found.note


def test_no_frames() -> None:
    with pytest.raises(InputError, match="frames: expected at least one, got none"):
        estimate_focal([], head_detector(), HEAD)
