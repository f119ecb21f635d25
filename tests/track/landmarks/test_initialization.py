"""Pose and face from landmarks without errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import posable
from marked import FOCAL, LAYOUT, SIZE, Blind, Shown, face_of, head_detector, posed, prepared
from mien.assets.landmark_sets import LANDMARK_COUNT
from mien.camera import Camera
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.errors import InputError
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.track.landmarks.fit import LandmarkObservation, LandmarkProblem, PoseAndFace, bounded_step
from mien.track.landmarks.initialization import HeadDetector
from mien.track.state import Layout, TrackState


def found(face: DetectedFace) -> TrackState:
    fit = head_detector().fit(face, size=SIZE, focal_px=FOCAL)
    assert fit is not None
    return fit.state


def assert_pose(state: TrackState, truth: TrackState, *, degrees: float, share: float) -> None:
    turned = angle_between(state.R_cam_head, truth.R_cam_head)
    assert np.degrees(turned) < degrees
    off = np.linalg.norm(state.t_cam_head - truth.t_cam_head) / truth.t_cam_head[2]
    assert off < share


@pytest.mark.parametrize("degrees", [(0, 0, 0), (10, -30, 5), (-15, 35, -20)])
def test_neutral_face_in_any_pose(degrees: tuple[float, float, float]) -> None:
    truth = posed(degrees)
    state = found(face_of(truth))
    assert_pose(state, truth, degrees=0.05, share=0.001)
    np.testing.assert_allclose(state.weights[:, 0], 1, atol=0.02)
    np.testing.assert_allclose(state.units, 0, atol=0.02)


def test_an_expression_in_one_region_and_another_in_the_rest() -> None:
    weights = np.array([[0.1, 0.9, 0, 0], [0.2, 0, 0.8, 0], [0.2, 0, 0.8, 0]])
    truth = posed(weights=weights)
    state = found(face_of(truth))
    assert_pose(state, truth, degrees=0.5, share=0.005)
    # What little moves around the eyes is taken to go with the rest.
    np.testing.assert_allclose(state.weights[[0, 2]], weights[[0, 2]], atol=0.3)
    np.testing.assert_array_equal(state.weights.argmax(axis=1), weights.argmax(axis=1))
    np.testing.assert_allclose(state.weights.sum(axis=1), 1, atol=1e-12)


def test_blink_of_one_eye() -> None:
    truth = posed(units=np.array([0.9, 0.0]))
    np.testing.assert_allclose(found(face_of(truth)).units, [0.9, 0.0], atol=0.12)


def test_a_quarter_of_outliers_is_ignored(rng: np.random.Generator) -> None:
    truth = posed()
    noise = np.zeros((LANDMARK_COUNT, 2))
    noise[rng.permutation(LANDMARK_COUNT)[: LANDMARK_COUNT // 4]] = (60.0, 40.0)
    assert_pose(found(face_of(truth, noise=noise)), truth, degrees=1.0, share=0.01)


@pytest.mark.parametrize("degrees", [(0.0, 0.0), (14.0, 0.0), (-10.0, 8.0)])
def test_gaze_follows_the_irises(degrees: tuple[float, float]) -> None:
    truth, model = posed(), head_detector().model
    camera = Camera(*SIZE, FOCAL, truth.R_cam_head, truth.t_cam_head)
    face = face_of(truth)
    points = face.points.copy()
    eyes = posable.GENERIC.mesh
    for side, iris in (("left", 473), ("right", 468)):
        ball = np.unique(eyes.triangles[eyes.triangles_of(f"{side}_eyeball")])
        centre = eyes.vertices[ball].mean(axis=0)
        yaw, pitch = np.radians(degrees)
        about_y, about_x = rotation_from_vector(np.array([[0, yaw, 0], [-pitch, 0, 0]]))
        place = centre + about_y @ about_x @ (model.positions[iris] - centre)
        points[iris, :2] = camera.project(place[None])[0]
    state = found(DetectedFace(points, face.blendshapes, face.R_cam_head))
    np.testing.assert_allclose(np.degrees(state.gaze), degrees, atol=1.0)


def test_closed_eyes_have_no_gaze() -> None:
    face = face_of(posed())
    points = face.points.copy()
    for upper, lower, iris in ((386, 374, 473), (159, 145, 468)):
        points[upper] = points[lower]
        points[iris] += (8, 0, 0)
    state = found(DetectedFace(points, face.blendshapes, face.R_cam_head))
    np.testing.assert_array_equal(state.gaze, 0)


def test_landmarks_outside_of_the_picture_have_no_weight() -> None:
    truth = replace(posed(), t_cam_head=np.array([230.0, -20.0, 600.0]))
    face = face_of(truth)
    outside = face.points[:, 0] > SIZE[0]
    assert 100 < outside.sum() < 300
    astray = face.points + np.where(outside, 25.0, 0.0)[:, None]
    state = found(DetectedFace(astray, face.blendshapes, face.R_cam_head))
    assert_pose(state, truth, degrees=0.5, share=0.005)
    exact = found(face)
    np.testing.assert_array_equal(state.R_cam_head, exact.R_cam_head)
    np.testing.assert_array_equal(state.t_cam_head, exact.t_cam_head)
    np.testing.assert_array_equal(state.weights, exact.weights)


def test_no_face_is_no_state() -> None:
    pixels = np.zeros((480, 640, 3), np.uint8)
    assert head_detector().detect(pixels, focal_px=FOCAL) == []
    assert head_detector().detect_near(pixels, posed().t_cam_head, focal_px=FOCAL) is None


def test_a_small_face_is_detected_again_in_a_crop(monkeypatch: pytest.MonkeyPatch) -> None:
    face = face_of(posed())
    corner = np.array([2000.0, 1000.0, 0.0])
    small = DetectedFace(face.points + corner, face.blendshapes, face.R_cam_head)
    pixels = np.zeros((2160, 3840, 3), np.uint8)
    rough = DetectedFace(small.points + 3, face.blendshapes, face.R_cam_head)
    low, high = rough.points[:, :2].min(axis=0), rough.points[:, :2].max(axis=0)
    cut_at = np.floor((low + high) / 2 - 0.75 * rough.width)
    near = DetectedFace(small.points - [*cut_at, 0.0], face.blendshapes, face.R_cam_head)
    again = Shown(rough, near)
    monkeypatch.setattr(head_detector(), "_detector", again)
    (seen,) = head_detector().detect_faces(pixels)
    assert again.sizes[0] == (3840, 2160)
    assert max(again.sizes[1]) < 600
    np.testing.assert_allclose(seen.points, small.points, atol=1e-9)


def test_head_with_neutral_only_is_fitted_by_its_units() -> None:
    head = posable.head_of(expressions={"neutral": posable.head().expressions["neutral"]})
    names = ("jawOpen", "mouthSmileLeft", "mouthSmileRight", "browInnerUp")
    one = prepared(head, Layout(("mouth", "eyes", "forehead"), ("neutral",), names))
    truth = posed(weights=np.ones((3, 1)), units=np.array([0.7, 0.0, 0.5, 0.4]))
    fit = one.fit(face_of(truth, of=one), size=SIZE, focal_px=FOCAL)
    assert fit is not None
    state = fit.state
    np.testing.assert_allclose(state.units, truth.units, atol=0.1)
    np.testing.assert_array_equal(state.weights, np.ones((3, 1)))


def test_layout_that_is_not_the_heads() -> None:
    with pytest.raises(InputError, match="unit: expected one of the head's"):
        HeadDetector(posable.head(), Layout(("mouth",), posable.NAMES, ("wink",)), Blind())


def test_errors_in_a_rendered_picture_of_the_estimate_are_subtracted() -> None:
    truth, errors = posed(), np.array([4.0, -3.0])
    model, camera = head_detector().model, Camera(*SIZE, FOCAL, truth.R_cam_head, truth.t_cam_head)
    estimate = PoseAndFace(truth.R_cam_head, truth.t_cam_head, np.zeros(len(model.offsets)))
    wrong = face_of(truth, noise=errors)
    seen = LandmarkObservation.from_detection(model, wrong, SIZE)
    corrected = seen.bias_corrected(wrong, estimate, SIZE, FOCAL)
    wanted = camera.project(seen.positions) - np.array(SIZE) / 2
    np.testing.assert_allclose(seen.image_points, wanted + errors, atol=1e-9)
    np.testing.assert_allclose(corrected.image_points, wanted, atol=1e-9)


def test_gradient_matches_differences_of_the_cost(rng: np.random.Generator) -> None:
    one = head_detector()
    drifting = replace(one.model, view_slopes=rng.normal(size=(3, LANDMARK_COUNT, 3)))
    truth = posed()
    seen = LandmarkObservation.from_detection(
        drifting, face_of(truth, noise=rng.normal(size=(478, 2))), SIZE
    )
    face = rng.uniform(0.1, 0.3, len(drifting.offsets))
    estimate = PoseAndFace(truth.R_cam_head, truth.t_cam_head, face)
    problem = LandmarkProblem(seen, LAYOUT, FOCAL, initial=estimate)
    _, gradient = problem.normal_equations(estimate)
    moves = np.delete(np.arange(len(gradient)), 6)  # All but the focal length.
    for index, unknown in enumerate(moves):
        step = np.zeros(len(moves))
        step[index] = 1e-5
        slope = problem.cost(estimate.plus(step)) - problem.cost(estimate.plus(-step))
        assert gradient[unknown] == pytest.approx(slope / 2e-5, rel=1e-4, abs=1e-4)


def test_bounded_step_decreases_the_quadratic_within_bounds(rng: np.random.Generator) -> None:
    root = rng.normal(size=(12, 6))
    hessian, gradient = root.T @ root, rng.normal(size=6) * 4
    low, high = np.full(6, -0.2), np.full(6, 0.3)
    low[0], high[1] = 0.0, 0.0
    step = bounded_step(hessian, gradient, low, high)
    assert (step >= low).all()
    assert (step <= high).all()
    assert step @ gradient + 0.5 * step @ hessian @ step < 0
    free = np.linalg.solve(hessian, -gradient)
    np.testing.assert_allclose(
        bounded_step(hessian, gradient, np.full(6, -np.inf), np.full(6, np.inf)), free
    )
