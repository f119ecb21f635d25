"""The joint solution on synthetic observations of points that are known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import angle_between, rotation_to_vector
from mien.numeric.similarity import estimate_similarity
from mien.reconstruction.bundle.problem import FocalGroups, Observations
from mien.reconstruction.dense.joint import JointSolution, solve_jointly
from observed import Scene, observed


def solved(scene: Scene, **options: object) -> JointSolution:
    given = {
        "cameras": scene.starts(),
        "points": scene.prior.mean,
        "observations": scene.observations,
        "prior": scene.prior,
        "focal": scene.focal(),
        "iterations": 40,
    }
    return solve_jointly(**(given | options))  # type: ignore[arg-type]


def turn_errors(solution: JointSolution, cameras: list[Camera]) -> Array:
    """Degrees that each photo's turn from the first is off."""
    found, true = solution.cameras, cameras
    return np.degrees(
        [
            angle_between(a.R_cam_head @ found[0].R_cam_head.T, b.R_cam_head @ true[0].R_cam_head.T)
            for a, b in zip(found[1:], true[1:], strict=True)
        ]
    )


def focal_errors(solution: JointSolution, cameras: list[Camera]) -> Array:
    found = [item.focal_px for item in solution.cameras]
    return np.log(found) - np.log([item.focal_px for item in cameras])


@pytest.mark.parametrize("seed", range(3))
def test_exact_sightings_from_three_sides(seed: int) -> None:
    scene = observed(seed, (-30, 0, 30))
    solution = solved(scene)
    assert solution.converged
    assert turn_errors(solution, scene.cameras).max() < 0.1
    assert np.abs(focal_errors(solution, scene.cameras)).max() < 0.02
    assert np.median(solution.normalized_residuals) < 0.1
    in_frame = estimate_similarity(solution.state.points, scene.points)
    off = np.linalg.norm(in_frame(solution.state.points) - scene.points, axis=1)
    assert np.median(off) < 0.1


def test_the_same_each_time() -> None:
    a, b = (solved(observed(0, (-30, 0, 30), noise_px=0.2)) for _ in range(2))
    np.testing.assert_array_equal(a.state.points, b.state.points)
    np.testing.assert_array_equal(a.covariance, b.covariance)


def test_photos_of_one_lens_have_one_focal_length() -> None:
    scene = observed(0, (-30, 0, 30), noise_px=0.2)
    shared = FocalGroups(np.array([0, 1, 0]), scene.focal().log_focal[:2], np.full(2, 0.3))
    solution = solved(scene, focal=shared)
    first, second, third = (item.focal_px for item in solution.cameras)
    assert first == third != second
    assert np.abs(focal_errors(solution, scene.cameras)).max() < 0.05


def test_a_fifth_of_wrong_matches_does_no_harm() -> None:
    scene = observed(1, (-30, 0, 30), noise_px=0.1)
    rng = np.random.default_rng(0)
    wrong = rng.random(len(scene.observations.photo)) < 0.2
    spoiled = (
        scene.observations.image_points + wrong[:, None] * rng.normal(size=(len(wrong), 2)) * 15
    )
    solution = solved(scene, observations=replace(scene.observations, image_points=spoiled))
    assert turn_errors(solution, scene.cameras).max() < 0.4


def slid(observations: Observations) -> Observations:
    """A third of them, less sure than the others, slide with the view by 3 px."""
    slides = np.arange(len(observations.photo)) % 3 == 0
    shift = np.where(slides, 3.0 * (observations.photo - 1), 0.0)
    return replace(
        observations,
        image_points=observations.image_points + np.column_stack([shift, 0 * shift]),
        sigma_px=np.where(slides, 3.0, observations.sigma_px),
        for_cameras=~slides,
    )


def test_what_does_not_guide_does_not_lead_the_cameras() -> None:
    scene = observed(2, (-30, 0, 30))
    solution = solved(scene, observations=slid(scene.observations))
    assert turn_errors(solution, scene.cameras).max() < 0.2


def test_instruments_take_the_bias_of_nearly_affine_pairs_out() -> None:
    """Of the same scenes, least squares turns the two cameras farther apart."""
    signed: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(24):
        scene = observed(seed, (-20, 20), distance=6000.0, noise_px=0.05, deviation_mm=8.0)
        true = np.degrees(angle_between(*(item.R_cam_head for item in scene.cameras)))
        for instruments, errors in signed.items():
            solution = solved(
                scene,
                cameras=scene.starts(0.5),
                instruments=instruments,
                iterations=150,
                tolerance=1e-5,
            )
            a, b = (item.R_cam_head for item in solution.cameras)
            errors.append(float(np.degrees(angle_between(a, b)) - true))
    plain, cured = np.array(signed[False]), np.array(signed[True])
    farther = plain - cured
    assert farther.mean() > 3 * farther.std() / np.sqrt(len(farther))
    assert abs(cured.mean()) < 2 * cured.std() / np.sqrt(len(cured))


def test_cameras_stay_without_data() -> None:
    scene = observed(3, (-20, 20))
    nothing = Observations(
        *(np.zeros(0, int), np.zeros(0, int)),
        *(np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool)),
    )
    solution = solved(scene, cameras=scene.cameras, observations=nothing)
    for a, b in zip(solution.cameras, scene.cameras, strict=True):
        assert angle_between(a.R_cam_head, b.R_cam_head) < 1e-6


def test_rotations_without_data_go_to_their_prior() -> None:
    scene = observed(3, (-20, 20))
    ignored = replace(scene.observations, sigma_px=np.full(len(scene.observations.photo), 1e6))
    means = np.stack([item.R_cam_head for item in scene.cameras])
    solution = solved(scene, cameras=scene.starts(3.0), observations=ignored, prior_rotations=means)
    for camera, anchor in zip(solution.cameras, means, strict=True):
        assert angle_between(camera.R_cam_head, anchor) < 1e-3


def test_covariance_is_the_priors_without_data_and_less_with_it() -> None:
    scene = observed(4, (-30, 0, 30))
    few = Observations(
        *(
            scene.observations.photo[:1],
            scene.observations.point[:1],
            scene.observations.image_points[:1],
        ),
        *(np.array([1e6]), scene.observations.for_cameras[:1]),
    )
    with_data = np.diagonal(solved(scene).covariance)
    without = np.diagonal(solved(scene, cameras=scene.cameras, observations=few).covariance)
    np.testing.assert_allclose(without[-4:], 1, rtol=1e-3)
    np.testing.assert_allclose(without[18:21], 0.3**2, rtol=1e-3)
    assert (with_data < without).all()
    assert with_data[-4:].max() < 0.1


def test_covariance_agrees_with_the_scatter() -> None:
    """Squared errors over what is predicted, over many scenes, average about one.

    Noise is stated as the program states it, half of what it then expects: it predicts too much
    rather than too little.
    """
    ratios: dict[str, list[float]] = {"shape": [], "turn": [], "focal length": []}
    for seed in range(24):
        scene = observed(seed, (-30, 0, 30), noise_px=0.3)
        solution = solved(scene, focal=scene.focal(0.05))
        covariance = solution.covariance
        shape = solution.state.coefficients - scene.coefficients
        ratios["shape"] += (shape**2 / np.diagonal(covariance)[-4:]).tolist()
        focal = focal_errors(solution, scene.cameras)
        ratios["focal length"] += (focal**2 / np.diagonal(covariance)[18:21]).tolist()
        (first, _, last), (true_first, _, true_last) = (
            [item.R_cam_head for item in cameras] for cameras in (solution.cameras, scene.cameras)
        )
        off = rotation_to_vector(last @ first.T @ true_first @ true_last.T)
        by_turns = np.zeros((3, len(covariance)))
        by_turns[:, :3], by_turns[:, 12:15] = -last @ first.T, np.eye(3)
        predicted = by_turns @ covariance @ by_turns.T
        ratios["turn"].append(float(off @ np.linalg.solve(predicted, off)) / 3)
    for name, values in ratios.items():
        assert 0.25 < np.mean(values) < 1.5, name
