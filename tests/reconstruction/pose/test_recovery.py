"""Pose recovery as a whole."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import EstimationError, InputError
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.reconstruction.bundle.adjustment import adjust_bundle
from mien.reconstruction.pose.initialization import estimate_poses
from mien.reconstruction.pose.recovery import recover_pose


def recover(scene, **options):
    return recover_pose(scene.image_points, scene.generic, scene.sizes, **options)


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
@pytest.mark.parametrize("seed", range(3))
def test_exact_scenes_are_recovered_exactly(make_scene, seed, loss):
    scene = make_scene(seed)
    result = recover(scene, loss=loss, max_sweeps=1000, tolerance=1e-12)
    assert result.converged
    assert result.problems == ("",) * 5
    degrees, focal, off = scene.errors(result.cameras, result.points)
    assert degrees.max() < 1e-6
    assert focal.max() < 1e-6
    assert off.max() < 1e-6


def test_thirteen_points_suffice(make_scene):
    scene = make_scene(4, count=13, hidden=False)
    result = recover(scene, max_sweeps=2000, tolerance=1e-12)
    assert scene.errors(result.cameras, result.points)[0].max() < 1e-4


@pytest.mark.parametrize("seed", range(4))
def test_five_steps_reach_the_bundle_adjusted_optimum(make_scene, seed):
    scene = make_scene(seed, noise=1.0)
    result = recover(scene, loss="linear")
    best = adjust_bundle(result.cameras, result.points, scene.image_points)
    assert result.cost <= 1.05**2 * np.nansum(best.residuals**2)
    assert result.cost == pytest.approx(np.nansum(best.residuals**2), rel=1e-3)


def test_acceleration_changes_the_way_not_the_answer(make_scene):
    scene = make_scene(1, noise=1.0)
    fast, plain = (recover(scene, loss="linear", history=h, max_sweeps=3000) for h in (10, 0))
    assert fast.cost == pytest.approx(plain.cost, rel=1e-4)
    assert fast.sweeps < plain.sweeps / 2


@pytest.mark.parametrize("seed", range(6))
def test_rough_starts_converge(make_scene, seed):
    """20 degrees and a factor of 2 in focal length off, the paper's way of starting."""
    scene, rng = make_scene(seed, noise=1.0), np.random.default_rng(seed)
    axes = rng.normal(size=(5, 3))
    axes *= np.deg2rad(20) / np.linalg.norm(axes, axis=1, keepdims=True)
    true = np.stack([camera.R_cam_head for camera in scene.cameras])
    focal = np.array([camera.focal_px for camera in scene.cameras])
    started = recover(
        scene,
        rotations=rotation_from_vector(axes) @ true,
        focal_px=focal * 2.0 ** rng.choice([-1, 1], 5),
    )
    assert started.cost == pytest.approx(recover(scene).cost, rel=1e-3)


def test_points_keep_the_initial_frame_and_scale(make_scene):
    scene = make_scene(2)
    result = recover(scene)
    twice = np.isfinite(scene.image_points[..., 0]).sum(axis=0) >= 2
    moved = scene.generic[twice] - result.points[twice]
    np.testing.assert_allclose(moved.mean(axis=0), 0, atol=1e-9)
    spread = result.points[twice] - result.points[twice].mean(axis=0)
    assert (moved * spread).sum() == pytest.approx(0, abs=1e-5)
    np.testing.assert_allclose(result.points[~twice], scene.generic[~twice], atol=1e-12)


def test_a_similarity_of_the_start_carries_over(make_scene):
    """Gauge: another frame and scale of the head give the same cameras, moved along."""
    scene = make_scene(3, noise=0.5)
    turn, shift = rotation_from_vector(np.array([0.3, 0.5, -0.2])), np.array([10.0, -20, 5])
    result = recover(scene)
    moved = recover_pose(scene.image_points, 1.2 * scene.generic @ turn.T + shift, scene.sizes)
    np.testing.assert_allclose(moved.points, 1.2 * result.points @ turn.T + shift, atol=0.02)
    for a, b in zip(result.cameras, moved.cameras, strict=True):
        assert b.focal_px == pytest.approx(a.focal_px, rel=1e-3)
        assert angle_between(a.R_cam_head, b.R_cam_head @ turn) < 1e-4


def test_principal_points_are_obeyed(make_scene):
    scene = make_scene(1)
    principal = scene.sizes / 2 + [[30.0, -20.0]]
    result = recover_pose(
        scene.image_points + np.array([30.0, -20.0]),
        scene.generic,
        scene.sizes,
        principal_px=principal,
        tolerance=1e-12,
    )
    assert scene.errors(result.cameras, result.points)[0].max() < 1e-4
    np.testing.assert_array_equal(result.cameras[0].principal, principal[0])


@pytest.mark.parametrize("seed", range(3))
def test_bad_points_are_distrusted(make_scene, seed):
    scene, rng = make_scene(seed, noise=0.5, hidden=False), np.random.default_rng(seed)
    bad = rng.random(scene.image_points.shape[:2]) < 0.1
    scene.image_points[bad] += 80 * rng.normal(size=(bad.sum(), 2))
    result = recover(scene)
    assert not (result.inliers & bad & (off_by(scene, result) > 10)).any()
    assert result.inliers[~bad].mean() > 0.98
    assert scene.errors(result.cameras, result.points)[0].max() < 0.5


def test_marks_that_agree_on_a_wrong_place_are_distrusted(make_scene):
    """Two photos show it, one of them wrong along the epipolar line: the rays meet, far off."""
    scene = make_scene(0, noise=0.5)
    point = int(np.flatnonzero(np.isfinite(scene.image_points[..., 0]).sum(axis=0) == 2)[0])
    wrong = scene.points.copy()
    first, second = np.flatnonzero(np.isfinite(scene.image_points[:, point, 0]))
    toward = scene.points[point] - scene.cameras[first].center
    wrong[point] += 90 * toward / np.linalg.norm(toward)
    scene.image_points[second, point] = scene.cameras[second].project(wrong)[point]
    result = recover(scene)
    assert not result.inliers[:, point].any()
    np.testing.assert_allclose(result.points[point], scene.generic[point], atol=1e-9)


def off_by(scene, result):
    projected = np.stack([camera.project(scene.points) for camera in scene.cameras])
    return np.linalg.norm(projected - scene.image_points, axis=-1)


def test_a_photo_of_something_else_is_left_out(make_scene):
    scene, rng = make_scene(0, noise=0.5), np.random.default_rng(0)
    clean = recover(scene)
    scene.image_points[2] = rng.permutation(scene.image_points[2])
    result = recover(scene)
    assert "mm off any view of the initial shape" in result.problems[2]
    assert [k for k, text in enumerate(result.problems) if text] == [2]
    assert result.cameras[2] is None
    assert np.isnan(result.rms_px[2])
    assert not result.inliers[2].any()
    assert result.rms_px[0] < 1.5 * clean.rms_px[0]


def test_a_photo_of_another_shape_is_left_out(make_scene):
    """The mouth region 25 mm lower in one photo: fits a head, but not this one."""
    scene = make_scene(0, noise=0.3, hidden=False)
    other = scene.points.copy()
    other[scene.points[:, 1] < 0] += [6.0, -14.0, 0]
    scene.image_points[1] = scene.cameras[1].project(other)
    result = recover(scene)
    assert result.cameras[1] is None
    assert "other photos" in result.problems[1]
    assert result.problems[0] == ""


def test_a_photo_with_few_points_is_left_out(make_scene):
    scene = make_scene(0)
    scene.image_points[4, 5:] = np.nan
    scene.image_points[4, :5] = 100.0
    result = recover(scene)
    assert result.problems[4] == "shows 5 points, needs 6"
    assert all(camera is not None for camera in result.cameras[:4])


def test_one_photo_is_placed_on_the_initial_shape(make_scene):
    scene = make_scene(0, yaws=(20,))
    result = recover_pose(scene.image_points, scene.points, scene.sizes)
    np.testing.assert_allclose(result.points, scene.points, atol=1e-12)
    found, true = result.cameras[0], scene.cameras[0]
    assert np.rad2deg(angle_between(found.R_cam_head, true.R_cam_head)) < 0.1


def test_weight_zero_hides_an_observation(make_scene):
    scene = make_scene(0)
    weights = np.ones(scene.image_points.shape[:2])
    weights[1, :10] = 0
    spoiled = scene.image_points.copy()
    spoiled[1, :10] += 300
    a = recover_pose(spoiled, scene.generic, scene.sizes, weights=weights, loss="linear")
    spoiled[1, :10] = np.nan
    b = recover_pose(spoiled, scene.generic, scene.sizes, loss="linear")
    np.testing.assert_allclose(a.points, b.points, atol=1e-9)
    assert not a.inliers[1, :10].any()


def test_the_reversed_relief_is_not_taken(make_scene):
    """Nearly affine views of a flat face: the start must not be the face turned inside out."""
    scene = make_scene(0, distance=(8000, 9000), hidden=False)
    flat = scene.generic.copy()
    center = flat.mean(axis=0)
    flat[:, 2] = center[2] + 0.35 * (flat[:, 2] - center[2])
    for camera in scene.cameras:
        image = (camera.project(flat) - camera.principal)[None]
        pose = estimate_poses(image, np.ones(image.shape[:2]), flat - center)
        assert np.rad2deg(angle_between(pose.R[0], camera.R_cam_head)) < 1


def test_nothing_fits(make_scene):
    scene = make_scene(0)
    with pytest.raises(EstimationError, match="no photo fits: shows 3 points, needs 6"):
        recover_pose(np.ones((5, 3, 2)), scene.generic[:3], scene.sizes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image_points": np.zeros((5, 59, 2))}, r"image_points: expected shape \(any, 60, 2\)"),
        ({"points": np.full((60, 3), np.nan)}, "points: expected finite numbers"),
        ({"sizes": np.zeros((5, 2))}, "sizes: expected widths and heights above zero"),
        ({"sizes": np.ones((4, 2))}, r"sizes: expected shape \(5, 2\)"),
        ({"weights": -np.ones((5, 60))}, "weights: expected numbers of 0 or more"),
        ({"weights": np.ones((5, 59))}, r"weights: expected shape \(5, 60\)"),
        ({"rotations": np.eye(3)}, r"rotations: expected shape \(5, 3, 3\)"),
        ({"focal_px": np.ones(4), "rotations": np.tile(np.eye(3), (5, 1, 1))}, "focal_px"),
        ({"loss": "best"}, "loss: expected linear or huber or cauchy, got best"),
    ],
)
def test_refuses_bad_input(make_scene, change, message):
    scene = make_scene(0)
    given = {"image_points": scene.image_points, "points": scene.generic, "sizes": scene.sizes}
    with pytest.raises(InputError, match=message):
        recover_pose(**{**given, **change})


def test_observations_of_different_precision(make_scene):
    """Weights are inverse variances: coarse marks neither spoil fine ones nor are thrown out."""
    scene, rng = make_scene(0, noise=0.0, hidden=False), np.random.default_rng(0)
    sigma = np.where(rng.random(scene.image_points.shape[:2]) < 0.3, 8.0, 0.5)
    scene.image_points[:] += sigma[..., None] * rng.normal(size=scene.image_points.shape)
    weighted = recover(scene, weights=1 / sigma**2)
    equal = recover(scene, loss="linear")
    assert weighted.inliers.mean() > 0.98
    degrees = scene.errors(weighted.cameras, weighted.points)[0].mean()
    assert degrees < 0.4 * scene.errors(equal.cameras, equal.points)[0].mean()
    scaled = recover(scene, weights=100 / sigma**2)
    np.testing.assert_allclose(scaled.points, weighted.points, atol=1e-4)


def test_good_points_are_kept(make_scene):
    for seed in range(6):
        scene = make_scene(seed, noise=1.0, count=100)
        seen = np.isfinite(scene.image_points[..., 0])
        np.testing.assert_array_equal(recover(scene).inliers, seen)
