"""The frame: seven motions of everything that no photo shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.reconstruction.bundle.gauge import FREEDOMS, gauge_motions
from mien.reconstruction.dense.joint import JointSolution, solve_jointly
from observed import Scene, observed


def solved(scene: Scene, **options: object) -> JointSolution:
    return solve_jointly(
        scene.starts(0.5), scene.prior.mean, scene.observations, scene.prior, scene.focal(0.05),
        **{"iterations": 60, "tolerance": 1e-9, **options},  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.parametrize("freedom", range(FREEDOMS))
def test_motions_change_no_image(freedom: int) -> None:
    found = solved(observed(0, (-30, 0, 30), noise_px=0.1), iterations=1)
    motions, state = gauge_motions(found.state), found.state
    size = 1e-5

    def image(sign: float) -> np.ndarray:
        common = np.append(sign * size * motions.cameras[:, freedom], np.zeros(4))
        moved = state.moved(common, sign * size * motions.points[..., freedom])
        return found.problem.project(moved, moved.points).image_points

    np.testing.assert_allclose((image(1) - image(-1)) / (2 * size), 0, atol=1e-3)


@pytest.mark.parametrize("instruments", [True, False])
def test_no_motion_brings_anything_nearer_to_what_is_believed(instruments: bool) -> None:
    found = solved(observed(1, (-30, 0, 30), noise_px=0.3), instruments=instruments, iterations=200)
    problem, motions = found.problem, gauge_motions(found.state)
    pull = np.einsum(
        "nij,nj->ni", problem.point_prior.precision, problem.point_deviations(found.state)
    )
    believed = problem.camera_prior.precision * problem.camera_prior.deviations(found.state)
    sums = np.einsum("nif,ni->f", motions.points, pull) + motions.cameras.T @ believed
    sizes = np.einsum("nif,ni->f", np.abs(motions.points), np.abs(pull))
    assert (np.abs(sums) < 1e-4 * sizes).all()


def test_noise_does_not_drive_the_head_away() -> None:
    """Places that deviate much and matches that err much leave the frame where prior put it."""
    scene = observed(2, (-45, -20, 0, 20, 45), noise_px=2.0, deviation_mm=6.0)
    found, plain = solved(scene), solved(scene, instruments=False)
    assert found.converged
    np.testing.assert_allclose(found.state.points.mean(axis=0), scene.points.mean(axis=0), atol=1.5)
    spreads = [np.linalg.norm(item.state.points.std(axis=0)) for item in (found, plain)]
    assert spreads[0] == pytest.approx(spreads[1], rel=5e-3)


def test_the_frame_of_the_start_does_not_matter() -> None:
    """Poses are believed in so weakly that the points decide."""
    scene = observed(3, (-30, 0, 30), noise_px=0.1)
    turn, shift, scale = (
        rotation_from_vector(np.array([0.02, -0.03, 0.01])),
        np.array([3, -2, 4]),
        1.03,
    )
    moved = replace(scene, cameras=[
        replace(item, R_cam_head=item.R_cam_head @ turn.T,
                t_cam_head=scale * item.t_cam_head - item.R_cam_head @ turn.T @ shift)
        for item in scene.cameras
    ])  # fmt: skip
    starts = scale * scene.points @ turn.T + shift
    for camera, other in zip(scene.cameras, moved.cameras, strict=True):
        np.testing.assert_allclose(other.project(starts), camera.project(scene.points), atol=1e-8)
    a, b = solved(scene), solved(moved)
    off = np.linalg.norm(a.state.points - b.state.points, axis=1)
    assert np.median(off) < 0.1


def test_one_photo() -> None:
    """A head that grows away from the only camera moves no camera: six motions are left."""
    scene = observed(4, (10,), noise_px=1.0)
    found = solved(scene)
    assert found.converged
    turned = angle_between(found.cameras[0].R_cam_head, scene.cameras[0].R_cam_head)
    assert np.degrees(turned) < 1.0
    np.testing.assert_allclose(found.state.points.mean(axis=0), scene.points.mean(axis=0), atol=1)
