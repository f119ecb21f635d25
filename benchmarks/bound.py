"""The Cramer-Rao bound on cameras recovered from feature points."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes import Scene
from mien.arrays import Array
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.adjustment import Posterior, camera_prior
from mien.reconstruction.bundle.gauge import similarity_constraints
from mien.reconstruction.bundle.problem import (
    BundleProblem,
    BundleState,
    FocalGroups,
    Observations,
    PointPrior,
)
from mien.reconstruction.bundle.projection import POSE_SIZE

__all__ = ["within_shares"]


def within_shares(
    scene: Scene,
    rng: np.random.Generator,
    angle: float,
    relative: float,
    *,
    sigma_px: float = 1.0,
    draws: int = 400,
) -> tuple[float, float, float]:
    """Shares that the best unbiased estimate, without priors, would bring within given errors.

    Args:
        angle: radians, of rotation.
        relative: of focal length.

    Returns:
        the share of cameras within `angle`, within `relative`, and how often all are within both;
        errors drawn from the bound's covariance, gauge fixed on the points.
    """
    photos = len(scene.cameras)
    size = POSE_SIZE * photos + photos
    covariance = _covariance(scene, sigma_px)[:size, :size]
    values, vectors = np.linalg.eigh(covariance)
    errors = rng.normal(size=(draws, size)) @ (vectors * np.sqrt(np.maximum(values, 0))).T
    poses = errors[:, : POSE_SIZE * photos].reshape(draws, photos, POSE_SIZE)
    turned = np.linalg.norm(poses[..., :3], axis=-1) <= angle
    zoomed = np.abs(errors[:, POSE_SIZE * photos :]) <= relative
    both = (turned & zoomed).all(axis=1)
    return float(turned.mean()), float(zoomed.mean()), float(both.mean())


def _covariance(scene: Scene, sigma_px: float) -> Array:
    """Of all poses and log focal lengths at the truth, after points are aligned."""
    photos, count = len(scene.cameras), len(scene.points)
    photo, point = np.nonzero(np.isfinite(scene.image_points[..., 0]))
    log_focal = np.log([camera.focal_px for camera in scene.cameras])
    groups = FocalGroups(np.arange(photos), log_focal, np.full(photos, np.inf))
    problem = BundleProblem(
        scene.cameras,
        Observations(
            photo,
            point,
            scene.image_points[photo, point],
            np.full(len(photo), sigma_px),
            np.ones(len(photo), bool),
        ),
        PointPrior(np.zeros((count, 3)), np.zeros((0, count, 3)), np.zeros((count, 3, 3))),
        camera_prior(scene.cameras, groups),
    )
    truth = BundleState.of(scene.cameras, scene.points, groups.group, 0)
    system = Posterior(problem, loss_named("linear"), None).normal_equations(truth)
    held = similarity_constraints(truth.points, ~system.open_blocks())
    return system.covariance(held)[0]
