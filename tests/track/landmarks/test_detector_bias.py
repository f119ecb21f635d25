"""Where a detector means its landmarks to be, from what it says of known views."""

from __future__ import annotations

import numpy as np
import pytest

import posable
from marked import FOCAL, FRONT, SIZE, Shown
from mien.arrays import Array
from mien.assets.landmark_sets import LANDMARK_COUNT
from mien.camera import Camera
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.numeric.rotation import rotation_from_vector
from mien.rig.rig import Rig
from mien.rig.state import FaceState
from mien.track.landmarks.detector_bias import (
    Pictures,
    Sight,
    facing,
    landmark_normals,
    places_meant,
    viewpoint,
    viewpoint_slopes,
)

ATTACHED = posable.GENERIC.landmark_positions(posable.REST)
NORMALS = landmark_normals(posable.GENERIC, posable.GENERIC.mesh)
VIEWS = [(0, 0, 600), (-20, 8, 600), (20, 8, 600), (-25, -6, 600), (25, -6, 600)]
VIEWS += [(0, 15, 600), (0, -15, 600), (0, 0, 350), (0, 0, 1200)]
SHIFT = np.array([2.0, -3.0, 0.0])


def sight(yaw: float, pitch: float, distance: float, drift: Array | None = None) -> Sight:
    """What is said of landmarks that are meant beside their places, farther with the view."""
    about_y, about_x = rotation_from_vector(np.radians([[0, yaw, 0], [pitch, 0, 0]]))
    camera = Camera(*SIZE, FOCAL, about_x @ about_y @ FRONT, np.array([0.0, 0.0, distance]))
    meant = ATTACHED + SHIFT
    if drift is not None:
        meant = meant + viewpoint(camera.R_cam_head, camera.t_cam_head) @ drift
    points = np.column_stack([camera.project(meant), np.zeros(LANDMARK_COUNT)])
    return Sight(camera, DetectedFace(points, np.full(52, 0.25), camera.R_cam_head))


def seen_by_all(sights: list[Sight]) -> Array:
    trust = [facing(sight.camera, ATTACHED, NORMALS) > 0.4 for sight in sights]
    return np.asarray(np.all(trust, axis=0))


def test_pictures_tell_where_a_landmark_is_meant() -> None:
    sights = [sight(*view) for view in VIEWS]
    meant = places_meant(ATTACHED, NORMALS, sights)
    seen = seen_by_all(sights)
    assert seen.sum() > 100
    np.testing.assert_allclose(meant.beside[seen], np.tile(SHIFT, (seen.sum(), 1)), atol=0.25)
    np.testing.assert_array_equal(meant.scores, 0.25)
    assert np.nanmax(np.abs(meant.misses[:, seen])) < 0.2


def test_pictures_tell_how_it_drifts_with_the_view() -> None:
    drift = np.zeros((3, 3))
    drift[0, 0], drift[1, 1], drift[2, 1] = 3.0, -2.0, 1.5
    sights = [sight(*view, drift) for view in VIEWS]
    found = places_meant(ATTACHED, NORMALS, sights)
    seen = seen_by_all(sights)
    # In part it looks as if the places lay deeper or less deep.
    for view, axis, amount in ((0, 0, 3.0), (1, 1, -2.0), (2, 1, 1.5)):
        assert np.median(found.drift[view, seen, axis]) == pytest.approx(amount, rel=0.3)
    assert np.nanmax(np.abs(found.misses[:, seen])) < 0.3
    # Once that is known, one picture is enough for what does not drift.
    known = np.tile(drift[:, None], (1, LANDMARK_COUNT, 1))
    alone = places_meant(ATTACHED, NORMALS, [sight(20, 8, 500, drift)], drift=known)
    off = alone.beside[seen] - SHIFT
    across = sight(20, 8, 500).camera.R_cam_head[:2]
    assert np.abs(off @ across.T).max() < 0.4


def test_without_pictures_landmarks_stay_where_they_are_attached() -> None:
    blind = places_meant(ATTACHED, NORMALS, [])
    assert not blind.seen
    np.testing.assert_array_equal(blind.beside, 0)
    np.testing.assert_array_equal(blind.drift, 0)
    change, scores = places_meant(ATTACHED + SHIFT, NORMALS, []).change_from(blind)
    np.testing.assert_allclose(change, np.tile(SHIFT, (LANDMARK_COUNT, 1)))
    np.testing.assert_array_equal(scores, 0)


def test_viewpoint_is_where_the_camera_is() -> None:
    R, t = sight(20, 0, 400).camera.R_cam_head, np.array([0.0, 0.0, 400.0])
    x, y, near = viewpoint(R, t)
    assert abs(x) == pytest.approx(np.sin(np.radians(20)))
    assert y == pytest.approx(0, abs=1e-12)
    assert near == pytest.approx(0.5)


def test_slopes_of_the_viewpoint(rng: np.random.Generator) -> None:
    R, t = rotation_from_vector(rng.normal(size=3)), np.array([30.0, -20.0, 500.0])

    def moved(step: Array) -> Array:
        x, y, z = t
        there = np.array([x + step[3], y + step[4], z * np.exp(step[5])])
        return viewpoint(rotation_from_vector(step[:3]) @ R, there)

    steps = 1e-6 * np.eye(6)
    numeric = np.array([(moved(step) - moved(-step)) / 2e-6 for step in steps]).T
    np.testing.assert_allclose(viewpoint_slopes(R, t), numeric, atol=1e-8)


def test_large_pictures_are_shown_smaller_and_found_in_their_own_pixels() -> None:
    face = DetectedFace(np.full((LANDMARK_COUNT, 3), 100.0), np.zeros(52), FRONT)
    detector = Shown(face)
    pictures = Pictures(Rig(posable.head()), posable.GENERIC.mesh, detector)
    camera = Camera(1920, 1080, 1500.0, FRONT, np.array([0.0, 0.0, 600.0]))
    found = pictures.show(FaceState(), camera)
    assert detector.sizes == [(640, 360)]
    assert found is not None
    np.testing.assert_allclose(found.points, 300.0)
