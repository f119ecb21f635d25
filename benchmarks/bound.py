"""The Cramer-Rao bound on cameras recovered from feature points."""

from __future__ import annotations

import numpy as np

from benchmarks.scenes import Scene
from mien.arrays import Array
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.problem import (
    POSE_SIZE,
    Bundle,
    BundleData,
    linearize_bundle,
    similarity_constraints,
)

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
    photos = len(scene.cameras)
    seen = np.isfinite(scene.image_points[..., :1])
    principal = np.stack([camera.principal for camera in scene.cameras])
    log_focal = np.log([camera.focal_px for camera in scene.cameras])
    data = BundleData(
        image=np.where(seen, scene.image_points - principal[:, None], 0.0),
        precision=seen[..., 0] / sigma_px,
        group=np.arange(photos),
        log_focal_mean=log_focal,
        log_focal_precision=np.zeros(photos),
        shape=None,
        loss=loss_named("linear"),
    )
    truth = Bundle(
        R=np.stack([camera.R_cam_head for camera in scene.cameras]),
        t=np.stack([camera.t_cam_head for camera in scene.cameras]),
        log_focal=log_focal,
        points=scene.points,
        coefficients=np.zeros(0),
    )
    system = linearize_bundle(truth, data)
    held = similarity_constraints(truth.points, ~system.open_blocks())
    return system.covariance(held)[0]
