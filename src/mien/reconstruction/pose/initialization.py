"""A camera from the points of a roughly known shape: where pose recovery starts."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.errors import EstimationError
from mien.numeric.solvers.robust import loss_named, robust_sigma
from mien.reconstruction.pose.linear_steps import (
    Poses,
    bounded_eta,
    reprojection,
    step_depth,
    step_rotation,
    step_scale,
    step_shift,
)
from mien.reconstruction.pose.problem import SIGMA_FLOOR_PX

__all__ = ["estimate_poses", "poses_from_rotations", "resect", "resect_robustly"]

_ROUNDS = 4
_FAR_START = 1 / 1000.0
"""eta of a camera 1 m away: what a start without any knowledge assumes."""


def estimate_poses(
    image: Float[Array, "k n 2"], weights: Float[Array, "k n"], points: Float[Array, "n 3"]
) -> Poses:
    """Scaled-orthographic poses of points whose shape is roughly known, in closed form.

    Every photo gets the affine camera that fits its points and of it the nearest scaled rotation.
    Points near a plane leave a twofold answer (the plane tilted one way or the other): both
    are tried with perspective, and the better is kept.

    Args:
        image: (K, N, 2) px relative to the principal points.
        weights: (K, N), 0 unseen.
        points: (N, 3) mm, relative to a place in their midst.

    Raises:
        EstimationError: a photo with fewer than four points, or all on one line.
    """
    rotations = np.stack(
        [_scaled_rotation(x, w, points) for x, w in zip(image, weights, strict=True)]
    )
    reversed_ = np.stack([_reversed(R, w, points) for R, w in zip(rotations, weights, strict=True)])
    first, second = (
        resect(poses_from_rotations(R, None, image, weights, points), points, image, weights)
        for R in (rotations, reversed_)
    )
    better = _rms(second, points, image, weights) < _rms(first, points, image, weights)
    photos = np.arange(len(better))
    return Poses.stacked([first, second]).of(photos + len(photos) * better)


def poses_from_rotations(
    rotations: Float[Array, "k 3 3"],
    focal_px: Float[Array, " k"] | None,
    image: Float[Array, "k n 2"],
    weights: Float[Array, "k n"],
    points: Float[Array, "n 3"],
) -> Poses:
    """Poses with given rotations: s and t fitted without perspective, eta from the focal length.

    Without focal lengths the cameras start 1 m away.
    """
    total = weights.sum(axis=1)[:, None]
    flat = points @ np.swapaxes(rotations, 1, 2)[..., :2]
    flat_mean = np.einsum("kn,knc->kc", weights, flat) / total
    image_mean = np.einsum("kn,knc->kc", weights, image) / total
    flat_spread, image_spread = flat - flat_mean[:, None], image - image_mean[:, None]
    above = np.einsum("kn,knc,knc->k", weights, flat_spread, image_spread)
    # A start far off may correlate badly with the photo; the sizes alone still give a scale.
    size = np.einsum("kn,knc,knc->k", weights, flat_spread, flat_spread)
    image_size = np.einsum("kn,knc,knc->k", weights, image_spread, image_spread)
    s = np.maximum(above / size, 0.3 * np.sqrt(image_size / size))
    eta = np.full(len(s), _FAR_START) if focal_px is None else s / focal_px
    return Poses(s, rotations, image_mean / s[:, None] - flat_mean, bounded_eta(eta))


def resect(
    poses: Poses,
    points: Float[Array, "n 3"],
    image: Float[Array, "k n 2"],
    weights: Float[Array, "k n"],
    *,
    sweeps: int = 30,
) -> Poses:
    """The four camera steps repeated over fixed points."""
    for _ in range(sweeps):
        poses = step_rotation(poses, points, image, weights)
        poses = step_shift(poses, points, image, weights)
        poses = step_depth(poses, points, image, weights)
        poses = step_scale(poses, points, image, weights)
    return poses


def resect_robustly(
    poses: Poses,
    points: Float[Array, "n 3"],
    image: Float[Array, "k n 2"],
    weights: Float[Array, "k n"],
    loss: str,
) -> tuple[Poses, Float[Array, " k"]]:
    """Poses over fixed points, and each photo's robust deviation from its pose in mm.

    The deviation is measured by the extent of the points, so that a pose gone wrong cannot hide
    or inflate it.
    """
    robust_weights, sigma = weights, np.ones(len(weights))
    for _ in range(_ROUNDS):
        poses = resect(poses, points, image, robust_weights)
        lengths = np.linalg.norm(reprojection(poses, points) - image, axis=-1) * np.sqrt(weights)
        sigma = np.array([robust_sigma(d[w > 0]) for d, w in zip(lengths, weights, strict=True)])
        sigma = np.maximum(sigma, SIGMA_FLOOR_PX)
        robust_weights = weights * loss_named(loss)((lengths / sigma[:, None]) ** 2)[1]
    # Weights are relative: a photo whose marks weigh more than another's is not farther off.
    return poses, sigma * np.array(
        [
            np.sqrt(points[w > 0].var(axis=0).sum() / max(x[w > 0].var(axis=0).sum(), 1e-12))
            / np.sqrt(np.median(w[w > 0]))
            for x, w in zip(image, weights, strict=True)
        ]
    )


def _scaled_rotation(image: Array, weights: Array, points: Array) -> Float[Array, "3 3"]:
    observed = weights > 0
    if np.count_nonzero(observed) < 4:
        raise EstimationError(f"a camera needs 4 points, there are {np.count_nonzero(observed)}")
    root = np.sqrt(weights[observed])[:, None]
    unknowns = np.column_stack([points[observed], np.ones(np.count_nonzero(observed))])
    affine = np.linalg.lstsq(root * unknowns, root * image[observed], rcond=1e-9)[0][:3].T
    u, singular, vt = np.linalg.svd(affine, full_matrices=False)
    if singular[1] < 1e-6 * singular[0]:
        raise EstimationError("a camera needs points that are not all on one line")
    top = u @ vt
    return np.vstack([top, np.cross(top[0], top[1])])


def _reversed(rotation: Array, weights: Array, points: Array) -> Float[Array, "3 3"]:
    """The rotation whose flat image of the points' main plane is the same (Necker reversal)."""
    observed = points[weights > 0]
    normal = np.linalg.svd(observed - observed.mean(axis=0), full_matrices=False)[2][2]
    return np.diag([1.0, 1.0, -1.0]) @ rotation @ (np.eye(3) - 2 * np.outer(normal, normal))


def _rms(poses: Poses, points: Array, image: Array, weights: Array) -> Float[Array, " k"]:
    squared = ((reprojection(poses, points) - image) ** 2).sum(axis=-1)
    return np.sqrt((weights * squared).sum(axis=1) / weights.sum(axis=1))
