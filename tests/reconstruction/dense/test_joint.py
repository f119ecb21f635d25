"""The joint solution on synthetic sightings of places that are known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import angle_between, rotation_to_vector
from mien.numeric.similarity import estimate_similarity
from mien.reconstruction.dense.joint import JointSolution, Lenses, Sightings, solve_jointly
from sighted import Scene, sighted


def solved(scene: Scene, **options: object) -> JointSolution:
    given = {
        "cameras": scene.starts(),
        "places": scene.prior.mean,
        "sightings": scene.sightings,
        "prior": scene.prior,
        "lenses": scene.lenses(),
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
    scene = sighted(seed, (-30, 0, 30))
    solution = solved(scene)
    assert solution.converged
    assert turn_errors(solution, scene.cameras).max() < 0.1
    assert np.abs(focal_errors(solution, scene.cameras)).max() < 0.02
    assert np.median(solution.off_sigmas) < 0.1
    in_frame = estimate_similarity(solution.places, scene.places)
    off = np.linalg.norm(in_frame(solution.places) - scene.places, axis=1)
    assert np.median(off) < 0.1


def test_the_same_each_time() -> None:
    a, b = (solved(sighted(0, (-30, 0, 30), noise_px=0.2)) for _ in range(2))
    np.testing.assert_array_equal(a.places, b.places)
    np.testing.assert_array_equal(a.covariance, b.covariance)


def test_photos_of_one_lens_have_one_focal_length() -> None:
    scene = sighted(0, (-30, 0, 30), noise_px=0.2)
    shared = Lenses(np.array([0, 1, 0]), scene.lenses().log_focal[:2], np.full(2, 0.3))
    solution = solved(scene, lenses=shared)
    first, second, third = (item.focal_px for item in solution.cameras)
    assert first == third != second
    assert np.abs(focal_errors(solution, scene.cameras)).max() < 0.05


def test_a_fifth_of_wrong_matches_does_no_harm() -> None:
    scene = sighted(1, (-30, 0, 30), noise_px=0.1)
    rng = np.random.default_rng(0)
    wrong = rng.random(len(scene.sightings.photo)) < 0.2
    spoiled = scene.sightings.image_points + wrong[:, None] * rng.normal(size=(len(wrong), 2)) * 15
    solution = solved(scene, sightings=replace(scene.sightings, image_points=spoiled))
    assert turn_errors(solution, scene.cameras).max() < 0.4


def slid(sightings: Sightings) -> Sightings:
    """A third of them, less sure than the others, slide with the view by 3 px."""
    slides = np.arange(len(sightings.photo)) % 3 == 0
    shift = np.where(slides, 3.0 * (sightings.photo - 1), 0.0)
    return replace(
        sightings,
        image_points=sightings.image_points + np.column_stack([shift, 0 * shift]),
        sigma_px=np.where(slides, 3.0, sightings.sigma_px),
        guides=~slides,
    )


def test_what_does_not_guide_does_not_lead_the_cameras() -> None:
    scene = sighted(2, (-30, 0, 30))
    solution = solved(scene, sightings=slid(scene.sightings))
    assert turn_errors(solution, scene.cameras).max() < 0.2


def test_instruments_take_the_bias_of_nearly_affine_pairs_out() -> None:
    """Of the same scenes, least squares turns the two cameras farther apart."""
    signed: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(24):
        scene = sighted(seed, (-20, 20), distance=6000.0, noise_px=0.05, deviation_mm=8.0)
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
    scene = sighted(3, (-20, 20))
    nothing = Sightings(
        *(np.zeros(0, int), np.zeros(0, int)),
        *(np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool)),
    )
    solution = solved(scene, cameras=scene.cameras, sightings=nothing)
    for a, b in zip(solution.cameras, scene.cameras, strict=True):
        assert angle_between(a.R_cam_head, b.R_cam_head) < 1e-6


def test_rotations_without_data_go_to_their_anchors() -> None:
    scene = sighted(3, (-20, 20))
    ignored = replace(scene.sightings, sigma_px=np.full(len(scene.sightings.photo), 1e6))
    anchors = np.stack([item.R_cam_head for item in scene.cameras])
    solution = solved(scene, cameras=scene.starts(3.0), sightings=ignored, anchors=anchors)
    for camera, anchor in zip(solution.cameras, anchors, strict=True):
        assert angle_between(camera.R_cam_head, anchor) < 1e-3


def test_covariance_is_the_priors_without_data_and_less_with_it() -> None:
    scene = sighted(4, (-30, 0, 30))
    few = Sightings(
        *(scene.sightings.photo[:1], scene.sightings.place[:1], scene.sightings.image_points[:1]),
        *(np.array([1e6]), scene.sightings.guides[:1]),
    )
    seen = np.diagonal(solved(scene).covariance)
    unseen = np.diagonal(solved(scene, cameras=scene.cameras, sightings=few).covariance)
    np.testing.assert_allclose(unseen[-4:], 1, rtol=1e-3)
    np.testing.assert_allclose(unseen[18:21], 0.3**2, rtol=1e-3)
    assert (seen < unseen).all()
    assert seen[-4:].max() < 0.1


def test_covariance_agrees_with_the_scatter() -> None:
    """Squared errors over what is predicted, over many scenes, average about one.

    Noise is stated as the program states it, half of what it then expects: it predicts too much
    rather than too little.
    """
    ratios: dict[str, list[float]] = {"shape": [], "turn": [], "focal length": []}
    for seed in range(24):
        scene = sighted(seed, (-30, 0, 30), noise_px=0.3)
        solution = solved(scene, lenses=scene.lenses(0.05))
        covariance = solution.covariance
        shape = solution.coefficients - scene.coefficients
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
