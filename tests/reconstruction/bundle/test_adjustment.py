"""Bundle adjustment: derivatives, optimum, priors, gauge, degenerate input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.errors import InputError
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.adjustment import FocalPrior, Posterior, ShapePrior, adjust_bundle
from mien.reconstruction.bundle.problem import (
    BundleProblem,
    BundleState,
    CameraPrior,
    FocalGroups,
    Observations,
    PointPrior,
)


def prior_of(scene, sigma=0.5):
    return ShapePrior(scene.generic, scene.components, np.full(len(scene.points), sigma))


def disturbed(scene, rng, size=1.0):
    """The true cameras and points, somewhat off."""
    cameras = [
        replace(
            camera,
            focal_px=camera.focal_px * (1 + 0.03 * size * rng.normal()),
            R_cam_head=rotation_from_vector(0.01 * size * rng.normal(size=3)) @ camera.R_cam_head,
            t_cam_head=camera.t_cam_head + size * rng.normal(size=3) * [1, 1, 10],
        )
        for camera in scene.cameras
    ]
    return cameras, scene.points + size * rng.normal(size=scene.points.shape)


def posterior_of(scene, cameras, sigma_px, *, focal, sigma=0.5, loss="linear", marginal=False):
    """The problem of these cameras; sigma is the points' prior deviation, infinite for none."""
    photo, point = np.nonzero(np.isfinite(scene.image_points[..., 0]))
    observations = Observations(
        photo,
        point,
        scene.image_points[photo, point],
        sigma_px[photo, point],
        np.ones(len(photo), bool),
    )
    count = len(scene.points)
    components = scene.components if np.isfinite(sigma) else scene.components[:0]
    prior = PointPrior(scene.generic, components, np.tile(np.eye(3) / sigma**2, (count, 1, 1)))
    R = np.stack([camera.R_cam_head for camera in cameras])
    t = np.stack([camera.t_cam_head for camera in cameras])
    poses = CameraPrior(R, t, focal, np.full(6, np.inf))
    problem = BundleProblem(cameras, observations, prior, poses)
    return Posterior(problem, loss_named(loss), np.full(count, sigma) if marginal else None)


def problem_of(scene, rng, *, loss="linear", shared=False):
    """A state near the truth and its posterior, every kind of prior included."""
    cameras, points = disturbed(scene, rng, 0.3)
    group = np.zeros(5, int) if shared else np.arange(5)
    log_focal = np.log([camera.focal_px for camera in cameras])[: group.max() + 1]
    focal = FocalGroups(group, log_focal + 0.1, np.full(len(log_focal), 0.2))
    sigma_px = 1 / rng.uniform(0.5, 2, scene.image_points.shape[:2])
    posterior = posterior_of(scene, cameras, sigma_px, focal=focal, loss=loss, marginal=True)
    state = BundleState.of(cameras, points, np.arange(5), 0)
    coefficients = rng.normal(size=len(scene.components))
    return replace(state, log_focal=log_focal, coefficients=coefficients), posterior


def step_along(state, index, size):
    """One of all unknowns moved: pose, focal, coefficient or point coordinate."""
    common = 6 * len(state.R) + len(state.log_focal) + len(state.coefficients)
    flat = np.zeros(common + state.points.size)
    flat[index] = size
    return state.moved(flat[:common], flat[common:].reshape(-1, 3))


def test_jacobian_against_central_differences(make_scene, rng):
    state, posterior = problem_of(make_scene(0), rng)
    problem = posterior.problem
    seen, projection = problem.observations, problem.project(state, state.points)
    by_photo, by_point = projection.camera_jacobian(), projection.point_jacobian
    h = 1e-5

    def numeric(index):
        moved = (step_along(state, index, s) for s in (h, -h))
        ahead, behind = (problem.project(item, item.points).image_points for item in moved)
        return (ahead - behind) / (2 * h)

    for k in (0, 3):
        own = seen.photo == k
        for unknown in range(6):
            np.testing.assert_allclose(
                numeric(6 * k + unknown)[own], by_photo[own, :, unknown], rtol=1e-6, atol=1e-5
            )
        np.testing.assert_allclose(numeric(30 + k)[own], by_photo[own, :, 6], rtol=1e-6, atol=1e-5)
    first_point, own = 35 + len(state.coefficients), seen.point == 7
    for axis in range(3):
        np.testing.assert_allclose(
            numeric(first_point + 3 * 7 + axis)[own], by_point[own, :, axis], atol=1e-6
        )


@pytest.mark.parametrize("loss", ["linear", "huber", "cauchy"])
@pytest.mark.parametrize("shared", [False, True])
def test_gradient_against_central_differences(make_scene, rng, loss, shared):
    state, posterior = problem_of(make_scene(0, noise=2), rng, loss=loss, shared=shared)
    system = posterior.normal_equations(state)
    gradient = np.append(system.common_gradient, system.block_gradient.ravel())
    for index in [*range(0, len(system.common_gradient), 3), len(gradient) - 5]:
        h = 1e-5
        ahead, behind = (posterior.cost(step_along(state, index, s)) for s in (h, -h))
        assert (ahead - behind) / (2 * h) == pytest.approx(gradient[index], rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_exact_scenes_are_recovered_exactly(make_scene, rng, seed):
    scene = make_scene(seed)
    result = adjust_bundle(*disturbed(scene, rng), scene.image_points, tolerance=1e-15)
    degrees, focal, off = scene.errors(result.cameras, result.points)
    assert result.converged
    assert degrees.max() < 1e-6
    assert focal.max() < 1e-6
    assert off.max() < 1e-6


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
@pytest.mark.parametrize("with_prior", [False, True])
def test_no_small_change_fits_better(make_scene, rng, loss, with_prior):
    scene = make_scene(0, noise=1.0)
    result = adjust_bundle(
        *disturbed(scene, rng),
        scene.image_points,
        loss=loss,
        shape_prior=prior_of(scene) if with_prior else None,
        tolerance=1e-14,
    )
    posterior = posterior_of(
        scene,
        result.cameras,
        np.ones(scene.image_points.shape[:2]),
        focal=FocalGroups(np.arange(5), np.zeros(5), np.full(5, np.inf)),
        sigma=0.5 if with_prior else np.inf,
        loss=loss,
        marginal=with_prior,
    )
    best = BundleState.of(result.cameras, result.points, np.arange(5), 0)
    best = replace(best, coefficients=result.coefficients)
    assert posterior.cost(best) == pytest.approx(result.cost)
    seen = np.flatnonzero(np.isfinite(scene.image_points[..., 0]).any(axis=0))
    first_point = 35 + len(best.coefficients)
    unknowns = [*range(first_point), *(first_point + 3 * seen[:5, None] + np.arange(3)).ravel()]
    for index in unknowns:
        for h in (-1e-4, 1e-4):
            assert posterior.cost(step_along(best, index, h)) > result.cost


def test_prior_fixes_the_frame(make_scene, rng):
    """Whatever frame the start is in, the answer is the same: mean and basis decide."""
    scene = make_scene(0, noise=0.5)
    cameras, points = disturbed(scene, rng)
    a = adjust_bundle(cameras, points, scene.image_points, shape_prior=prior_of(scene))
    turn, scale = rotation_from_vector(np.array([0.1, 0.2, -0.1])), 1.1
    turned = [
        replace(c, R_cam_head=c.R_cam_head @ turn.T, t_cam_head=scale * c.t_cam_head)
        for c in cameras
    ]
    b = adjust_bundle(
        turned, scale * points @ turn.T, scene.image_points, shape_prior=prior_of(scene)
    )
    np.testing.assert_allclose(a.points, b.points, atol=2e-3)
    assert a.cost == pytest.approx(b.cost, rel=1e-6)


def test_without_a_prior_the_gauge_does_not_matter(make_scene, rng):
    scene = make_scene(0, noise=0.5)
    cameras, points = disturbed(scene, rng)
    turn = rotation_from_vector(np.array([0.4, -0.3, 0.2]))
    turned = [replace(c, R_cam_head=c.R_cam_head @ turn.T) for c in cameras]
    a = adjust_bundle(cameras, points, scene.image_points, tolerance=1e-13)
    b = adjust_bundle(turned, points @ turn.T, scene.image_points, tolerance=1e-13)
    assert a.cost == pytest.approx(b.cost, rel=1e-9)
    np.testing.assert_allclose(a.residuals, b.residuals, atol=1e-3)


def test_prior_tells_points_that_no_photo_shows(make_scene, rng):
    scene = make_scene(0, noise=0.3)
    scene.image_points[:, 5] = np.nan
    cameras, points = disturbed(scene, rng)
    result = adjust_bundle(cameras, points, scene.image_points, shape_prior=prior_of(scene, 0.1))
    believed = scene.generic + np.tensordot(result.coefficients, scene.components, 1)
    np.testing.assert_allclose(result.points[5], believed[5], atol=1e-6)
    assert np.linalg.norm(result.points[5] - scene.points[5]) < 1.0
    assert 0.15 < result.point_sd_mm[5] < 3


def test_deviations_tell_the_errors(make_scene):
    """Over many noisy scenes, squared errors over predicted variances average one."""
    ratios = {"points": [], "turns": [], "focals": []}
    for seed in range(12):
        scene = make_scene(seed, noise=1.0)
        result = adjust_bundle(scene.cameras, scene.points, scene.image_points)
        degrees, focal, off = scene.errors(result.cameras, result.points)
        twice = np.isfinite(scene.image_points[..., 0]).sum(axis=0) >= 2
        ratios["points"].append(np.mean((off / result.point_sd_mm[twice]) ** 2))
        ratios["turns"].append(np.mean((np.deg2rad(degrees) / result.rotation_sd) ** 2))
        ratios["focals"].append(np.mean((focal / result.focal_sd) ** 2))
    for values in ratios.values():
        assert 0.6 < np.mean(values) < 1.6


def test_a_point_seen_once_is_infinitely_uncertain(make_scene):
    scene = make_scene(0, noise=0.5)
    scene.image_points[1:, 3] = np.nan
    result = adjust_bundle(scene.cameras, scene.points, scene.image_points)
    assert np.isinf(result.point_sd_mm[3])
    assert np.isfinite(result.rotation_sd).all()


def test_focal_prior_pulls(make_scene):
    scene = make_scene(0, noise=0.5)
    wrong = np.array([1.2 * camera.focal_px for camera in scene.cameras])
    known = FocalPrior(wrong, np.full(5, 1e-4))
    result = adjust_bundle(scene.cameras, scene.points, scene.image_points, focal_prior=known)
    np.testing.assert_allclose([c.focal_px for c in result.cameras], wrong, rtol=2e-3)
    half = FocalPrior(np.where(np.arange(5) == 0, wrong, np.nan), np.full(5, 1e-4))
    result = adjust_bundle(scene.cameras, scene.points, scene.image_points, focal_prior=half)
    assert result.cameras[0].focal_px == pytest.approx(wrong[0], rel=2e-3)
    assert result.cameras[1].focal_px != pytest.approx(wrong[1], rel=0.02)


def test_photos_of_one_camera_share_their_focal_length(make_scene):
    scene = make_scene(0, noise=0.5)
    result = adjust_bundle(
        scene.cameras, scene.points, scene.image_points, focal_group=[7, 7, 3, 3, 7]
    )
    focal = np.array([camera.focal_px for camera in result.cameras])
    assert focal[0] == focal[1] == focal[4]
    assert focal[2] == focal[3] != focal[0]


def test_robust_loss_survives_bad_points(make_scene, rng):
    scene = make_scene(0, noise=0.5, hidden=False)
    bad = rng.random(scene.image_points.shape[:2]) < 0.05
    scene.image_points[bad] += 60 * rng.normal(size=(bad.sum(), 2))
    cameras, points = disturbed(scene, rng, 0.3)
    off = {
        loss: scene.errors(*_answer(adjust_bundle(cameras, points, scene.image_points, loss=loss)))
        for loss in ("linear", "cauchy")
    }
    assert off["cauchy"][0].max() < 0.3 < off["linear"][0].max()


def _answer(result):
    return result.cameras, result.points


def test_two_long_lenses_need_the_prior(make_scene, rng):
    """Two nearly affine views leave their angle open; knowledge of the shape settles it."""
    scene = make_scene(0, yaws=(-24, 24), noise=1.0, distance=(1500, 1500))
    cameras, points = disturbed(scene, rng)
    with_prior = adjust_bundle(cameras, points, scene.image_points, shape_prior=prior_of(scene))
    without = adjust_bundle(cameras, points, scene.image_points)

    def turned(result):
        return abs(angle_of(result.cameras) - angle_of(scene.cameras))

    assert turned(with_prior) < 1.5
    assert turned(without) > 2 * turned(with_prior)
    assert np.median(scene.errors(with_prior.cameras, with_prior.points)[2]) < 0.6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": np.zeros((60, 2))}, r"points: expected shape \(any, 3\)"),
        ({"image_points": np.zeros((4, 60, 2))}, r"image_points: expected shape \(5, 60, 2\)"),
        ({"sigma_px": 0.0}, "sigma_px: expected numbers above zero, got 0"),
        ({"loss": "l1"}, "loss: expected linear or huber or cauchy, got l1"),
        ({"focal_group": [1, 2]}, r"focal_group: expected shape \(5\)"),
        (
            {"focal_prior": FocalPrior(np.full(5, -1.0), np.ones(5))},
            "focal_prior: expected numbers above zero",
        ),
        (
            {"shape_prior": ShapePrior(np.zeros((60, 3)), np.zeros((1, 60, 3)), np.zeros(60))},
            "shape_prior.sigma: expected numbers above zero",
        ),
        (
            {"shape_prior": ShapePrior(np.zeros((59, 3)), np.zeros((1, 60, 3)), np.ones(60))},
            r"shape_prior.mean: expected shape \(60, 3\)",
        ),
    ],
)
def test_refuses_bad_input(make_scene, change, message):
    scene = make_scene(0)
    given = {
        "cameras": scene.cameras,
        "points": scene.points,
        "image_points": scene.image_points,
    }
    with pytest.raises(InputError, match=message):
        adjust_bundle(**{**given, **change})


def test_marginal_cameras_are_unbiased(make_scene):
    """Long lenses and a basis that may stretch the relief: joint optima miss the angle one way."""
    missed = {True: [], False: []}
    for seed in range(10):
        scene = make_scene(seed, yaws=(-24, 24), count=110, distance=(1500, 1500))
        rng = np.random.default_rng(seed)
        stretches = 0.1 * (scene.generic - scene.generic.mean(axis=0)) * np.eye(3)[:, None]
        components = np.concatenate([scene.components, stretches])
        points = scene.generic + np.tensordot(rng.normal(size=12), components, 1)
        points += 2 * rng.normal(size=points.shape)
        seen_at = np.stack([camera.project(points) for camera in scene.cameras])
        seen_at += 1.5 * rng.normal(size=seen_at.shape)
        seen_at[np.isnan(scene.image_points)] = np.nan
        prior = ShapePrior(scene.generic, components, np.full(110, 2.0))
        for marginal, found in missed.items():
            result = adjust_bundle(
                scene.cameras,
                points,
                seen_at,
                sigma_px=1.5,
                shape_prior=prior,
                marginal=marginal,
            )
            found.append(angle_of(result.cameras) - angle_of(scene.cameras))
    assert np.mean(missed[False]) < -2.0
    assert abs(np.mean(missed[True])) < 1.0


def angle_of(cameras):
    """Degrees between the first two."""
    return np.rad2deg(angle_between(*(camera.R_cam_head for camera in cameras[:2])))


def test_agrees_with_scipy(make_scene, rng):
    """The same cost as a general solver reaches by numeric derivatives."""
    from scipy.optimize import least_squares

    scene = make_scene(0, yaws=(-40, 0, 40), noise=1.0, count=13, hidden=False)
    cameras, points = disturbed(scene, rng, 0.5)
    result = adjust_bundle(
        cameras,
        points,
        scene.image_points,
        shape_prior=prior_of(scene),
        marginal=False,
        tolerance=1e-13,
    )
    focal = FocalGroups(np.arange(3), np.zeros(3), np.full(3, np.inf))
    problem = posterior_of(scene, cameras, np.ones((3, 13)), focal=focal).problem
    start = BundleState.of(cameras, points, focal.group, 9)

    def residuals(x):
        state = start.moved(x[:30], x[30:].reshape(-1, 3))
        believed = scene.generic + np.tensordot(state.coefficients, scene.components, 1)
        projected = problem.project(state, state.points).image_points
        return np.concatenate(
            [
                (projected - problem.image).ravel(),
                ((state.points - believed) / 0.5).ravel(),
                state.coefficients,
            ]
        )

    best = least_squares(residuals, np.zeros(30 + 39), x_scale="jac", ftol=1e-12, xtol=1e-12)
    assert result.cost == pytest.approx(best.cost, rel=1e-7)
    assert result.cost <= best.cost * (1 + 1e-9)
