"""The bundle adjustment problem: unknowns, residuals, their derivatives and normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.numeric.rotation import cross_matrix, rotation_from_vector
from mien.numeric.solvers.robust import Loss
from mien.numeric.solvers.schur import BlockSystem
from mien.reconstruction.bundle.marginal_likelihood import point_evidence

__all__ = [
    "POSE_SIZE",
    "Bundle",
    "BundleData",
    "ShapePrior",
    "bundle_cost",
    "bundle_jacobians",
    "bundle_residuals",
    "linearize_bundle",
    "move_bundle",
    "similarity_constraints",
]

POSE_SIZE = 6
"""Unknowns of a photo's step: rotation vector, shift in x and y (mm), log depth."""


@dataclass(frozen=True)
class ShapePrior:
    """What is known of the shape beforehand: m_i = mean_i + sum_c c B_ci + d_i.

    The coefficients c are independent with mean 0 and deviation 1, each coordinate of d_i has
    deviation sigma_i.

    Attributes:
        mean: (N, 3) mm.
        components: (C, N, 3) mm.
        sigma: (N,) mm, infinite where nothing is known.
    """

    mean: Float[Array, "n 3"]
    components: Float[Array, "c n 3"]
    sigma: Float[Array, " n"]


@dataclass(frozen=True)
class Bundle:
    """The unknowns.

    Attributes:
        R: (K, 3, 3) R_cam_head.
        t: (K, 3) mm.
        log_focal: (G,), one a group of photos.
        points: (N, 3) mm.
        coefficients: (C,) of the shape prior.
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    log_focal: Float[Array, " g"]
    points: Float[Array, "n 3"]
    coefficients: Float[Array, " c"]


@dataclass(frozen=True)
class BundleData:
    """What is observed and believed.

    Attributes:
        image: (K, N, 2) px relative to the principal points, 0 where unseen.
        precision: (K, N) 1 / px, 0 where unseen.
        group: (K,) index of each photo's focal length.
        log_focal_mean: (G,) and log_focal_precision: (G,), 0 without a prior.
        shape: the shape prior or None.
        loss: of squared residuals over their variance.
        marginal: integrate over the points' places (bundle.marginal_likelihood); needs shape.
    """

    image: Float[Array, "k n 2"]
    precision: Float[Array, "k n"]
    group: Int[Array, " k"]
    log_focal_mean: Float[Array, " g"]
    log_focal_precision: Float[Array, " g"]
    shape: ShapePrior | None
    loss: Loss
    marginal: bool = False


def bundle_residuals(bundle: Bundle, data: BundleData) -> Float[Array, "k n 2"]:
    """(Projected - observed) over sigma; 0 where unseen."""
    in_camera = bundle.points @ np.swapaxes(bundle.R, 1, 2) + bundle.t[:, None]
    focal = np.exp(bundle.log_focal)[data.group][:, None, None]
    projected = focal * in_camera[..., :2] / in_camera[..., 2:]
    return data.precision[..., None] * (projected - data.image)


def bundle_cost(bundle: Bundle, data: BundleData) -> float:
    """Minus the logarithm of the posterior, up to a constant; infinite with a point behind."""
    in_camera = bundle.points @ np.swapaxes(bundle.R[:, 2:], 1, 2) + bundle.t[:, None, 2:]
    if (in_camera[data.precision > 0] <= 0).any():
        return np.inf
    squared = (bundle_residuals(bundle, data) ** 2).sum(axis=-1)
    cost = data.loss(squared)[0].sum()
    cost += (_focal_residuals(bundle, data) ** 2).sum() + (bundle.coefficients**2).sum()
    if data.shape is not None:
        cost += (_shape_residuals(bundle, data.shape) ** 2).sum()
    return 0.5 * float(cost) + _evidence(bundle, data)[0]


def move_bundle(bundle: Bundle, step: tuple[Array, Array]) -> Bundle:
    """The unknowns after a step: (common (6K + G + C,), points (N, 3))."""
    common, point_step = step
    photos, groups = len(bundle.R), len(bundle.log_focal)
    pose, focal, coefficients = np.split(common, [POSE_SIZE * photos, POSE_SIZE * photos + groups])
    pose = pose.reshape(photos, POSE_SIZE)
    # Depth moves by a factor, so that focal length and distance trade along a straight line.
    depth = bundle.t[:, 2] * np.exp(np.clip(pose[:, 5], -3, 3))
    return Bundle(
        rotation_from_vector(pose[:, :3]) @ bundle.R,
        np.column_stack([bundle.t[:, :2] + pose[:, 3:5], depth]),
        bundle.log_focal + np.clip(focal, -3, 3),
        bundle.points + point_step,
        bundle.coefficients + coefficients,
    )


def bundle_jacobians(
    bundle: Bundle, data: BundleData
) -> tuple[Float[Array, "k n 2 7"], Float[Array, "k n 2 3"]]:
    """Derivatives of bundle_residuals by the photo's step (6 and its log focal) and the point."""
    rotated = bundle.points @ np.swapaxes(bundle.R, 1, 2)
    x, y, z = np.moveaxis(rotated + bundle.t[:, None], -1, 0)
    scale = np.exp(bundle.log_focal)[data.group][:, None] * data.precision / z
    by_camera = np.zeros((*x.shape, 2, 3))
    by_camera[..., 0, 0], by_camera[..., 0, 2] = scale, -scale * x / z
    by_camera[..., 1, 1], by_camera[..., 1, 2] = scale, -scale * y / z
    by_photo = np.empty((*x.shape, 2, 7))
    by_photo[..., :3] = -by_camera @ cross_matrix(rotated)
    by_photo[..., 3:5] = by_camera[..., :2]
    by_photo[..., 5] = by_camera[..., 2] * bundle.t[:, None, 2:]
    by_photo[..., 6] = scale[..., None] * np.stack([x, y], axis=-1)
    by_point: Array = by_camera @ bundle.R[:, None]
    return by_photo, by_point


def linearize_bundle(bundle: Bundle, data: BundleData) -> BlockSystem:
    """Normal equations in the step, the points as blocks.

    Robust terms enter by their weights, the evidence by its gradient.
    """
    residuals = bundle_residuals(bundle, data)
    by_photo, by_point = bundle_jacobians(bundle, data)
    root = np.sqrt(data.loss((residuals**2).sum(axis=-1))[1])[..., None]
    residuals, by_photo, by_point = (
        residuals * root,
        by_photo * root[..., None],
        by_point * root[..., None],
    )
    photos, points = len(bundle.R), len(bundle.points)
    size = POSE_SIZE * photos + len(bundle.log_focal) + len(bundle.coefficients)
    common, gradient = np.zeros((size, size)), np.zeros(size)
    coupling = np.zeros((points, size, 3))
    by_evidence = _evidence(bundle, data)[1]
    for k in range(photos):
        own = _columns(k, photos, data.group)
        gradient[own] += by_evidence[k]
        flat = by_photo[k].reshape(-1, POSE_SIZE + 1)
        common[np.ix_(own, own)] += flat.T @ flat
        gradient[own] += flat.T @ residuals[k].ravel()
        coupling[:, own] += np.swapaxes(by_photo[k], 1, 2) @ by_point[k]
    stacked = np.swapaxes(by_point, 0, 1).reshape(points, 2 * photos, 3)
    blocks = np.swapaxes(stacked, 1, 2) @ stacked
    block_gradient = np.einsum("knij,kni->nj", by_point, residuals)
    system = BlockSystem(common, blocks, coupling, gradient, block_gradient)
    _add_priors(system, bundle, data)
    return system


def similarity_constraints(
    points: Float[Array, "n 3"], counts: Bool[Array, " n"]
) -> Float[Array, "n 7 3"]:
    """What a similarity changes of the points that count: their mean, their turn, their size."""
    spread = points - points[counts].mean(axis=0)
    spread = spread / np.sqrt((spread[counts] ** 2).mean())
    rows = np.concatenate(
        [np.tile(np.eye(3), (len(points), 1, 1)), cross_matrix(spread), spread[:, None]], axis=1
    )
    return rows * counts[:, None, None]


def _columns(photo: int, photos: int, group: Int[Array, " k"]) -> Int[Array, " 7"]:
    """Places of a photo's seven unknowns in the common step."""
    pose = POSE_SIZE * photo + np.arange(POSE_SIZE)
    return np.append(pose, POSE_SIZE * photos + group[photo])


def _evidence(bundle: Bundle, data: BundleData) -> tuple[float, Float[Array, "k 7"]]:
    """Of the points' places, at the prior's mean, so that it is a matter of the cameras alone."""
    if data.shape is None or not data.marginal:
        return 0.0, np.zeros((len(bundle.R), POSE_SIZE + 1))
    focal = np.exp(bundle.log_focal)[data.group]
    return point_evidence(
        bundle.R, bundle.t, focal, data.precision, data.shape.mean, data.shape.sigma
    )


def _focal_residuals(bundle: Bundle, data: BundleData) -> Float[Array, " g"]:
    return data.log_focal_precision * (bundle.log_focal - data.log_focal_mean)


def _shape_residuals(bundle: Bundle, shape: ShapePrior) -> Float[Array, "n 3"]:
    believed = shape.mean + np.tensordot(bundle.coefficients, shape.components, 1)
    return (bundle.points - believed) / shape.sigma[:, None]


def _add_priors(system: BlockSystem, bundle: Bundle, data: BundleData) -> None:
    """Adds the focal and shape priors to the system's arrays, in place."""
    first = POSE_SIZE * len(bundle.R)
    focal = first + np.arange(len(bundle.log_focal))
    system.common[focal, focal] += data.log_focal_precision**2
    system.common_gradient[focal] += data.log_focal_precision * _focal_residuals(bundle, data)
    if data.shape is None:
        return
    precision = 1 / data.shape.sigma
    residuals = _shape_residuals(bundle, data.shape)
    by_coefficient = -data.shape.components * precision[:, None]
    system.blocks[:, range(3), range(3)] += (precision**2)[:, None]
    system.block_gradient[:] += precision[:, None] * residuals
    rest = slice(focal[-1] + 1, None)
    count = len(bundle.coefficients)
    flat = by_coefficient.reshape(count, -1)
    system.common[rest, rest] += flat @ flat.T + np.eye(count)
    system.common_gradient[rest] += flat @ residuals.ravel() + bundle.coefficients
    system.coupling[:, rest] += np.swapaxes(by_coefficient, 0, 1) * precision[:, None, None]
