"""The joint solution on synthetic sightings of places that are known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.model.dense.joint import JointSolution, Lenses, PlacePrior, Sightings, solve_jointly
from mien.model.dense.projection import Pinholes, project_places
from mien.numeric.rotation import angle_between, rotation_from_vector
from people import camera

PLACES = 90


def scene(
    seed: int,
    yaws: tuple[float, ...],
    *,
    distance: float = 900.0,
    noise_px: float = 0.0,
    deviation_mm: float = 1.5,
) -> tuple[list[Camera], Array, Sightings, PlacePrior]:
    """Cameras, true places, what is seen of them, and a prior that they are drawn from."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform([-60, -80, -30], [60, 60, 40], size=(PLACES, 3))
    components = rng.normal(size=(4, PLACES, 3))
    places = mean + np.tensordot(rng.normal(size=4), components, 1)
    places += deviation_mm * rng.normal(size=places.shape)
    cameras = [camera(yaw, 4 * (-1) ** k, distance=distance) for k, yaw in enumerate(yaws)]
    cameras = [replace(item, focal_px=3.0 * distance) for item in cameras]
    image = np.concatenate([item.project(places) for item in cameras])
    count = len(cameras)
    sightings = Sightings(
        photo=np.repeat(np.arange(count), PLACES),
        place=np.tile(np.arange(PLACES), count),
        image_points=image + noise_px * rng.normal(size=image.shape),
        sigma_px=np.full(count * PLACES, max(noise_px, 0.05)),
        guides=np.ones(count * PLACES, bool),
    )
    prior = PlacePrior(mean, components, np.tile(np.eye(3) / deviation_mm**2, (PLACES, 1, 1)))
    return cameras, places, sightings, prior


def lenses(cameras: list[Camera], deviation: float = 0.3) -> Lenses:
    focal = np.log([item.focal_px for item in cameras])
    return Lenses(np.arange(len(cameras)), focal, np.full(len(cameras), deviation))


def started(cameras: list[Camera], degrees: float = 2.0) -> list[Camera]:
    rng = np.random.default_rng(5)
    turns = rotation_from_vector(np.radians(degrees) * rng.normal(size=(len(cameras), 3)) / 2)
    return [
        replace(item, R_cam_head=turn @ item.R_cam_head, focal_px=1.05 * item.focal_px)
        for item, turn in zip(cameras, turns, strict=True)
    ]


def turn_errors(solution: JointSolution, cameras: list[Camera]) -> Array:
    """Degrees that each photo's turn from the first is off."""
    found, true = solution.cameras, cameras
    return np.degrees(
        [
            angle_between(a.R_cam_head @ found[0].R_cam_head.T, b.R_cam_head @ true[0].R_cam_head.T)
            for a, b in zip(found[1:], true[1:], strict=True)
        ]
    )


def test_exact_sightings_from_three_sides() -> None:
    cameras, places, sightings, prior = scene(0, (-30, 0, 30))
    solution = solve_jointly(
        started(cameras), prior.mean, sightings, prior, lenses(cameras), iterations=30
    )
    assert solution.converged
    assert turn_errors(solution, cameras).max() < 0.1
    ratios = [a.focal_px / b.focal_px for a, b in zip(solution.cameras, cameras, strict=True)]
    assert np.abs(np.log(ratios)).max() < 0.02
    assert np.median(solution.off_sigmas) < 0.1
    assert len(solution.places) == len(places)


def test_a_fifth_of_wrong_matches_does_no_harm() -> None:
    cameras, _, sightings, prior = scene(1, (-30, 0, 30), noise_px=0.1)
    rng = np.random.default_rng(0)
    wrong = rng.random(len(sightings.photo)) < 0.2
    spoiled = sightings.image_points + wrong[:, None] * rng.normal(size=(len(wrong), 2)) * 15
    solution = solve_jointly(
        started(cameras),
        prior.mean,
        replace(sightings, image_points=spoiled),
        prior,
        lenses(cameras),
        iterations=40,
    )
    assert turn_errors(solution, cameras).max() < 0.4


def test_what_does_not_guide_does_not_lead_the_cameras() -> None:
    """Sightings that slide with the view, each photo's by 3 px to one side."""
    cameras, _, sightings, prior = scene(2, (-30, 0, 30))
    slides = np.arange(len(sightings.photo)) % 3 == 0
    shift = np.where(slides, 3.0 * (sightings.photo - 1), 0.0)
    moved = replace(
        sightings,
        image_points=sightings.image_points + np.column_stack([shift, 0 * shift]),
        sigma_px=np.where(slides, 3.0, sightings.sigma_px),
        guides=~slides,
    )
    solution = solve_jointly(
        started(cameras), prior.mean, moved, prior, lenses(cameras), iterations=30
    )
    assert turn_errors(solution, cameras).max() < 0.2


def test_instruments_take_the_bias_of_nearly_affine_pairs_out() -> None:
    """Of the same scenes, least squares turns the two cameras farther apart."""
    signed: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(24):
        cameras, _, sightings, prior = scene(
            seed, (-20, 20), distance=6000.0, noise_px=0.05, deviation_mm=8.0
        )
        true = np.degrees(angle_between(cameras[0].R_cam_head, cameras[1].R_cam_head))
        for instruments, errors in signed.items():
            solution = solve_jointly(
                started(cameras, 0.5),
                prior.mean,
                sightings,
                prior,
                lenses(cameras),
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


def test_anchored_rotations_stay_near_their_anchors_without_data() -> None:
    cameras, _, sightings, prior = scene(3, (-20, 20))
    nothing = Sightings(
        *(np.zeros(0, int), np.zeros(0, int)),
        *(np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool)),
    )
    assert len(sightings.photo) > 0
    solution = solve_jointly(cameras, prior.mean, nothing, prior, lenses(cameras))
    for a, b in zip(solution.cameras, cameras, strict=True):
        assert angle_between(a.R_cam_head, b.R_cam_head) < 1e-6


def test_covariance_is_the_priors_without_data_and_less_with_it() -> None:
    cameras, _, sightings, prior = scene(4, (-30, 0, 30))
    seen = solve_jointly(cameras, prior.mean, sightings, prior, lenses(cameras)).covariance
    few = Sightings(
        *(sightings.photo[:1], sightings.place[:1], sightings.image_points[:1]),
        *(np.array([1e6]), sightings.guides[:1]),
    )
    open_ = solve_jointly(cameras, prior.mean, few, prior, lenses(cameras)).covariance
    np.testing.assert_allclose(np.diagonal(open_)[-4:], 1, rtol=1e-3)
    np.testing.assert_allclose(np.diagonal(open_)[18:21], 0.3**2, rtol=1e-3)
    assert (np.diagonal(seen) < np.diagonal(open_)).all()
    assert np.diagonal(seen)[-4:].max() < 0.1


@pytest.mark.parametrize("unknown", range(7))
def test_derivatives_against_differences(unknown: int) -> None:
    cameras, places, sightings, _ = scene(6, (-25, 10))
    pinholes = Pinholes.of(cameras)
    seen = project_places(pinholes, sightings.photo, places[sightings.place])
    step, sides = 1e-6, []
    for sign in (1, -1):
        move = np.zeros(7)
        move[unknown] = sign * step
        moved = Pinholes(
            rotation_from_vector(np.tile(move[:3], (2, 1))) @ pinholes.R,
            np.column_stack([pinholes.t[:, :2] + move[3:5], pinholes.t[:, 2] * np.exp(move[5])]),
            pinholes.focal_px * np.exp(move[6]),
        )
        sides.append(project_places(moved, sightings.photo, places[sightings.place]).image_points)
    difference = (sides[0] - sides[1]) / (2 * step)
    np.testing.assert_allclose(seen.by_camera()[..., unknown], difference, rtol=1e-5, atol=1e-3)
