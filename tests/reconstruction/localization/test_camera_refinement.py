"""One camera from points that are visible, exactly and not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import at
from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.localization.camera_refinement import FocalLengthPrior, refine_camera

TRUE = at(70.0, 8.0, -5.0)
SIGMA_PX = 1.5
BELIEF = FocalLengthPrior(1.1 * TRUE.focal_px, 0.05)


@pytest.fixture
def points(rng: np.random.Generator) -> Array:
    return rng.normal(scale=50.0, size=(80, 3))


def degrees(one: Camera, other: Camera) -> float:
    return float(np.degrees(angle_between(one.R_cam_head, other.R_cam_head)))


def nudged(camera: Camera, step: Array) -> Camera:
    """Turned (rad), shifted (mm), and zoomed (log)."""
    return replace(
        camera,
        R_cam_head=rotation_from_vector(step[:3]) @ camera.R_cam_head,
        t_cam_head=camera.t_cam_head + step[3:6],
        focal_px=camera.focal_px * np.exp(step[6]),
    )


def cost(camera: Camera, points: Array, seen: Array) -> float:
    off = (((camera.project(points) - seen) / SIGMA_PX) ** 2).sum(axis=1)
    prior = np.log(camera.focal_px / BELIEF.focal_px) / BELIEF.deviation
    return float(loss_named("cauchy")(off)[0].sum() + prior**2)


def test_refined_camera_is_the_optimum(points: Array, rng: np.random.Generator) -> None:
    seen = TRUE.project(points) + rng.normal(scale=SIGMA_PX, size=(80, 2))
    seen[:8] += 60
    start = nudged(TRUE, np.array([0.05, -0.1, 0.08, 5, -4, 30, 0.05]))
    found = refine_camera(start, points, seen, sigma_px=SIGMA_PX, focal=BELIEF)
    assert found is not None
    assert degrees(found, TRUE) < 0.5
    least = cost(found, points, seen)
    for k, size in enumerate((1e-3, 1e-3, 1e-3, 0.1, 0.1, 2.0, 5e-3)):
        for sign in (-1, 1):
            step = np.zeros(7)
            step[k] = sign * size
            assert cost(nudged(found, step), points, seen) > least


def test_belief_decides_the_focal_length_where_the_pairs_do_not(points: Array) -> None:
    """From far away a longer lens farther off shows nearly the same."""
    far = at(70.0, distance=20_000.0)
    focal_prior = FocalLengthPrior(1.1 * far.focal_px, 0.01)
    found = refine_camera(far, points, far.project(points), sigma_px=SIGMA_PX, focal=focal_prior)
    assert found is not None
    assert abs(found.focal_px / focal_prior.focal_px - 1) < 0.01


def test_a_camera_inside_the_head_is_none(points: Array) -> None:
    near = replace(TRUE, t_cam_head=np.array([0.0, 0.0, 400.0]))
    wide = FocalLengthPrior(0.1 * TRUE.focal_px, 0.01)
    seen = TRUE.project(points)
    assert refine_camera(near, points, seen, sigma_px=SIGMA_PX, focal=wide) is None
