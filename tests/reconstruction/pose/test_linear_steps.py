"""Each of [Pighin 2002]'s steps against its own quadratic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.pose.linear_steps import (
    Poses,
    reprojection,
    step_depth,
    step_points,
    step_rotation,
    step_scale,
    step_shift,
)

CAMERA_STEPS = (step_scale, step_rotation, step_shift, step_depth)


@pytest.fixture
def truth(make_scene):
    """Poses, points, image points about the optical axis, weights; exact."""
    scene = make_scene(hidden=False)
    center = scene.points.mean(axis=0)
    t = np.stack([camera.t_cam_head + camera.R_cam_head @ center for camera in scene.cameras])
    focal = np.array([camera.focal_px for camera in scene.cameras])
    R = np.stack([camera.R_cam_head for camera in scene.cameras])
    poses = Poses(focal / t[:, 2], R, t[:, :2], 1 / t[:, 2])
    image = scene.image_points - np.stack([camera.principal for camera in scene.cameras])[:, None]
    return poses, scene.points - center, image, np.ones(image.shape[:2])


def frozen_cost(poses, points, image, weights, w):
    """Eq. (2) squared and summed per photo, with w held."""
    rotated = points @ np.swapaxes(poses.R, 1, 2)
    depth = (1 + poses.eta[:, None] * rotated[..., 2])[..., None]
    s = poses.s[:, None, None]
    rows = image * depth - s * (rotated[..., :2] + poses.t[:, None])
    return (weights * w**2 * (rows**2).sum(axis=-1)).sum()


def frozen_w(poses, points):
    return 1 / (1 + poses.eta[:, None] * (points @ np.swapaxes(poses.R, 1, 2))[..., 2])


def disturbed(poses, rng):
    count = len(poses.s)
    return Poses(
        poses.s * (1 + 0.02 * rng.normal(size=count)),
        rotation_from_vector(0.02 * rng.normal(size=(count, 3))) @ poses.R,
        poses.t + rng.normal(size=(count, 2)),
        poses.eta * (1 + 0.05 * rng.normal(size=count)),
    )


def test_reprojection_is_the_cameras_projection(truth):
    poses, points, image, _ = truth
    np.testing.assert_allclose(reprojection(poses, points), image, atol=1e-9)


@pytest.mark.parametrize("step", CAMERA_STEPS)
def test_the_truth_stays(truth, step):
    poses, points, image, weights = truth
    stepped = step(poses, points, image, weights)
    for name in ("s", "R", "t", "eta"):
        np.testing.assert_allclose(getattr(stepped, name), getattr(poses, name), atol=1e-10)


def test_true_points_stay_and_lost_ones_return(truth, rng):
    poses, points, image, weights = truth
    lost = points + rng.normal(size=points.shape)
    for _ in range(4):
        lost = step_points(poses, lost, image, weights, lost)
    np.testing.assert_allclose(lost, points, atol=1e-6)


def test_a_point_seen_once_moves_to_its_ray_and_no_farther(truth, rng):
    poses, points, image, weights = truth
    weights[1:, 0] = 0
    weights[:, 1] = 0
    anchor = points + 3 * rng.normal(size=points.shape)
    moved = step_points(poses, points, image, weights, anchor)
    np.testing.assert_allclose(reprojection(poses, moved)[0, 0], image[0, 0], atol=0.05)
    assert np.linalg.norm(moved[0] - anchor[0]) < np.linalg.norm(points[0] - anchor[0]) * 1.01
    np.testing.assert_array_equal(moved[1], anchor[1])


@pytest.mark.parametrize(
    ("step", "name"), [(step_scale, "s"), (step_shift, "t"), (step_depth, "eta")]
)
def test_each_camera_step_is_the_optimum_of_its_quadratic(truth, rng, step, name):
    poses, points, image, weights = truth
    poses = disturbed(poses, rng)
    w = frozen_w(poses, points)
    solved = step(poses, points, image, weights)
    best = frozen_cost(solved, points, image, weights, w)
    value = getattr(solved, name)
    for place in np.ndindex(value.shape):
        for factor in (-1, 1):
            nudged = value.copy()
            nudged[place] += factor * 1e-3 * max(abs(value[place]), 1e-6)
            changed = replace(solved, **{name: nudged})
            assert frozen_cost(changed, points, image, weights, w) > best


def test_points_are_the_optimum_of_their_quadratic(truth, rng):
    poses, points, image, weights = truth
    poses = disturbed(poses, rng)
    w = frozen_w(poses, points)
    solved = step_points(poses, points, image, weights, points)
    best = frozen_cost(poses, solved, image, weights, w)
    for point in range(3):
        for step in 1e-2 * np.vstack([np.eye(3), -np.eye(3)]):
            nudged = solved.copy()
            nudged[point] += step
            assert frozen_cost(poses, nudged, image, weights, w) > best


def test_rotation_step_goes_downhill_to_the_truth(truth, rng):
    poses, points, image, weights = truth
    turned = replace(
        poses, R=rotation_from_vector(0.1 * rng.normal(size=(len(poses.s), 3))) @ poses.R
    )
    for _ in range(20):
        turned = step_rotation(turned, points, image, weights)
    np.testing.assert_allclose(turned.R, poses.R, atol=1e-9)


def test_steps_leave_a_photo_without_observations_alone(truth, rng):
    poses, points, image, weights = truth
    poses = disturbed(poses, rng)
    weights[2] = 0
    for step in CAMERA_STEPS:
        stepped = step(poses, points, image, weights)
        for name in ("s", "R", "t", "eta"):
            np.testing.assert_allclose(getattr(stepped, name)[2], getattr(poses, name)[2])
