"""Recovered cameras against the true ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.scenes import FeatureHead, Scene
from mien.arrays import Array, Float
from mien.camera import Camera
from mien.numeric.rotation import angle_between
from mien.numeric.similarity import estimate_similarity
from mien.reconstruction.bundle.adjustment import Adjustment, FocalPrior, adjust_bundle
from mien.reconstruction.pose.recovery import PoseResult, recover_pose

__all__ = ["Errors", "adjust", "angle_error", "focal_prior", "measure", "recover"]


@dataclass(frozen=True)
class Errors:
    """Of one scene, after the similarity that best aligns the points seen twice is removed.

    Attributes:
        degrees: (K,) rotation.
        focal: (K,) relative.
        surface_mm: median over points seen twice.
    """

    degrees: Float[Array, " k"]
    focal: Float[Array, " k"]
    surface_mm: float


def measure(cameras: Sequence[Camera | None], points: Array, scene: Scene) -> Errors:
    """Errors of an answer in which no photo is left out."""
    found = [camera for camera in cameras if camera is not None]
    twice = np.isfinite(scene.image_points[..., 0]).sum(axis=0) >= 2
    move = estimate_similarity(points[twice], scene.points[twice])
    rotations = np.stack([camera.R_cam_head for camera in found]) @ move.rotation.T
    true = np.stack([camera.R_cam_head for camera in scene.cameras])
    focal = np.array([camera.focal_px for camera in found])
    true_focal = np.array([camera.focal_px for camera in scene.cameras])
    off = np.linalg.norm(move(points) - scene.points, axis=1)
    return Errors(
        np.rad2deg(angle_between(rotations, true)),
        np.abs(focal / true_focal - 1),
        float(np.median(off[twice])),
    )


def recover(scene: Scene, head: FeatureHead) -> PoseResult:
    """[Pighin 2002]'s five steps from the generic head's points, nothing else known."""
    return recover_pose(scene.image_points, head.points, scene.sizes)


def adjust(scene: Scene, start: PoseResult, **priors: object) -> Adjustment:
    """Bundle adjustment of what the five steps inliers."""
    cameras = [camera for camera in start.cameras if camera is not None]
    seen = np.where(start.inliers[..., None], scene.image_points, np.nan)
    return adjust_bundle(cameras, start.points, seen, **priors)  # type: ignore[arg-type]


def focal_prior(scene: Scene, rng: np.random.Generator, deviation: float) -> FocalPrior:
    """Focal lengths known as well as this, as from a photo's EXIF."""
    true = np.array([camera.focal_px for camera in scene.cameras])
    believed = true * np.exp(deviation * rng.normal(size=len(true)))
    return FocalPrior(believed, np.full(len(true), deviation))


def angle_error(cameras: Sequence[Camera | None], scene: Scene) -> float:
    """Degrees by which the angle between the first two views is wrong."""
    first, second = (camera.R_cam_head for camera in cameras[:2] if camera is not None)
    true = angle_between(scene.cameras[0].R_cam_head, scene.cameras[1].R_cam_head)
    return float(np.rad2deg(np.abs(angle_between(first, second) - true)))
