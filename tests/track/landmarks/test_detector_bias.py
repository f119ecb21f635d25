"""A detector's bias from its results in known views."""

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
    DetectorProbe,
    ProbeDetection,
    estimate_bias,
    facing_weights,
    landmark_normals,
    viewpoint,
    viewpoint_jacobian,
)

POSITIONS = posable.GENERIC.landmark_positions(posable.REST)
NORMALS = landmark_normals(posable.GENERIC, posable.GENERIC.mesh)
VIEWS = [(0, 0, 600), (-20, 8, 600), (20, 8, 600), (-25, -6, 600), (25, -6, 600)]
VIEWS += [(0, 15, 600), (0, -15, 600), (0, 0, 350), (0, 0, 1200)]
SHIFT = np.array([2.0, -3.0, 0.0])


def detection(
    yaw: float, pitch: float, distance: float, view_slopes: Array | None = None
) -> ProbeDetection:
    """A detection of landmarks that are offset by SHIFT, and by more with the viewpoint."""
    about_y, about_x = rotation_from_vector(np.radians([[0, yaw, 0], [pitch, 0, 0]]))
    camera = Camera(*SIZE, FOCAL, about_x @ about_y @ FRONT, np.array([0.0, 0.0, distance]))
    bias = POSITIONS + SHIFT
    if view_slopes is not None:
        bias = bias + viewpoint(camera.R_cam_head, camera.t_cam_head) @ view_slopes
    points = np.column_stack([camera.project(bias), np.zeros(LANDMARK_COUNT)])
    return ProbeDetection(camera, DetectedFace(points, np.full(52, 0.25), camera.R_cam_head))


def visible_in_all(detections: list[ProbeDetection]) -> Array:
    weights = [
        facing_weights(detection.camera, POSITIONS, NORMALS) > 0.4 for detection in detections
    ]
    return np.asarray(np.all(weights, axis=0))


def test_offsets_are_estimated() -> None:
    detections = [detection(*view) for view in VIEWS]
    bias = estimate_bias(POSITIONS, NORMALS, detections)
    visible = visible_in_all(detections)
    assert visible.sum() > 100
    np.testing.assert_allclose(bias.offsets[visible], np.tile(SHIFT, (visible.sum(), 1)), atol=0.25)
    np.testing.assert_array_equal(bias.scores, 0.25)
    assert np.nanmax(np.abs(bias.residuals[:, visible])) < 0.2


def test_changes_with_the_viewpoint_are_estimated() -> None:
    view_slopes = np.zeros((3, 3))
    view_slopes[0, 0], view_slopes[1, 1], view_slopes[2, 1] = 3.0, -2.0, 1.5
    detections = [detection(*view, view_slopes) for view in VIEWS]
    bias = estimate_bias(POSITIONS, NORMALS, detections)
    visible = visible_in_all(detections)
    # It is partly confounded with the depth of the offsets.
    for view, axis, amount in ((0, 0, 3.0), (1, 1, -2.0), (2, 1, 1.5)):
        assert np.median(bias.view_slopes[view, visible, axis]) == pytest.approx(amount, rel=0.3)
    assert np.nanmax(np.abs(bias.residuals[:, visible])) < 0.3
    # Once that is known, one picture determines the constant part.
    known = np.tile(view_slopes[:, None], (1, LANDMARK_COUNT, 1))
    alone = estimate_bias(
        POSITIONS, NORMALS, [detection(20, 8, 500, view_slopes)], view_slopes=known
    )
    off = alone.offsets[visible] - SHIFT
    image_axes = detection(20, 8, 500).camera.R_cam_head[:2]
    assert np.abs(off @ image_axes.T).max() < 0.4


def test_without_detections_there_are_no_offsets() -> None:
    blind = estimate_bias(POSITIONS, NORMALS, [])
    assert not blind.detected
    np.testing.assert_array_equal(blind.offsets, 0)
    np.testing.assert_array_equal(blind.view_slopes, 0)
    change, scores = estimate_bias(POSITIONS + SHIFT, NORMALS, []).change_from(blind)
    np.testing.assert_allclose(change, np.tile(SHIFT, (LANDMARK_COUNT, 1)))
    np.testing.assert_array_equal(scores, 0)


def test_viewpoint_is_the_camera_position() -> None:
    R, t = detection(20, 0, 400).camera.R_cam_head, np.array([0.0, 0.0, 400.0])
    x, y, near = viewpoint(R, t)
    assert abs(x) == pytest.approx(np.sin(np.radians(20)))
    assert y == pytest.approx(0, abs=1e-12)
    assert near == pytest.approx(0.5)


def test_jacobian_of_the_viewpoint(rng: np.random.Generator) -> None:
    R, t = rotation_from_vector(rng.normal(size=3)), np.array([30.0, -20.0, 500.0])

    def moved(step: Array) -> Array:
        x, y, z = t
        there = np.array([x + step[3], y + step[4], z * np.exp(step[5])])
        return viewpoint(rotation_from_vector(step[:3]) @ R, there)

    steps = 1e-6 * np.eye(6)
    numeric = np.array([(moved(step) - moved(-step)) / 2e-6 for step in steps]).T
    np.testing.assert_allclose(viewpoint_jacobian(R, t), numeric, atol=1e-8)


def test_large_pictures_are_rendered_smaller_with_results_in_their_own_pixels() -> None:
    face = DetectedFace(np.full((LANDMARK_COUNT, 3), 100.0), np.zeros(52), FRONT)
    detector = Shown(face)
    probe = DetectorProbe(Rig(posable.head()), posable.GENERIC.mesh, detector)
    camera = Camera(1920, 1080, 1500.0, FRONT, np.array([0.0, 0.0, 600.0]))
    bias = probe.detect(FaceState(), camera)
    assert detector.sizes == [(640, 360)]
    assert bias is not None
    np.testing.assert_allclose(bias.points, 300.0)
