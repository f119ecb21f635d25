"""Joint bundle adjustment of cameras and points, with what is known of the shape beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.camera import Camera
from mien.errors import EstimationError, InputError
from mien.numeric.solvers.levenberg_marquardt import LevenbergMarquardtResult, minimize_lm
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.problem import (
    POSE_SIZE,
    Bundle,
    BundleData,
    ShapePrior,
    bundle_cost,
    linearize_bundle,
    move_bundle,
    similarity_constraints,
)

__all__ = ["Adjustment", "FocalPrior", "ShapePrior", "adjust_bundle"]


@dataclass(frozen=True)
class FocalPrior:
    """What is known of the focal lengths.

    Attributes:
        focal_px: (K,) expected; NaN where nothing is known.
        deviation: (K,) standard deviation of log(focal), about the relative error.
    """

    focal_px: Float[Array, " k"]
    deviation: Float[Array, " k"]


@dataclass(frozen=True)
class Adjustment:
    """Cameras and points of highest posterior.

    Attributes:
        cameras: one a photo.
        points: (N, 3) mm.
        coefficients: (C,) of the shape prior.
        residuals: (K, N, 2) px, projected less observed, NaN where unseen.
        cost: minus the log posterior up to a constant.
        iterations: of the solver.
        converged: of the solver.
        point_sd_mm: (N,) standard deviation of a point's place (all three axes together), and
        rotation_sd: (K,) radians, focal_sd: (K,) relative, all at the given sigma_px and priors.
            Infinite where the data do not tell. Without a shape prior they are those left after the
            points seen twice are aligned by a similarity.
    """

    cameras: tuple[Camera, ...]
    points: Float[Array, "n 3"]
    coefficients: Float[Array, " c"]
    residuals: Float[Array, "k n 2"]
    cost: float
    iterations: int
    converged: bool
    point_sd_mm: Float[Array, " n"]
    rotation_sd: Float[Array, " k"]
    focal_sd: Float[Array, " k"]


def adjust_bundle(
    cameras: Sequence[Camera],
    points: Float[Array, "n 3"],
    image_points: Float[Array, "k n 2"],
    *,
    sigma_px: float | Float[Array, "k n"] = 1.0,
    loss: str = "linear",
    shape_prior: ShapePrior | None = None,
    focal_prior: FocalPrior | None = None,
    focal_group: Int[Array, " k"] | None = None,
    marginal: bool = True,
    max_iterations: int = 200,
    tolerance: float = 1e-10,
) -> Adjustment:
    """Minimizes reprojection error and priors over all cameras and points at once.

    Principal points stay. Without a shape prior a common similarity of cameras and points changes
    nothing, and the answer stays near the start's frame and scale; with one, the prior's
    frame and scale (63 mm between the pupils) decide. A point that neither two photos nor the
    prior tell moves as little as the fit allows.

    Args:
        cameras: K starts, from recover_pose.
        points: (N, 3) mm start.
        image_points: (K, N, 2) px, NaN where unseen.
        sigma_px: standard deviation of an observation per axis, one number or (K, N).
        loss: "linear", "huber" or "cauchy", for observations of which some are wrong.
        shape_prior: as the classes say; absent means nothing known.
        focal_prior: as the classes say; absent means nothing known.
        focal_group: (K,) photos with the same number share their focal length.
        marginal: with a shape prior, find the cameras of highest probability over all places that
            the points may have, not of the most probable places (bundle.marginal_likelihood).

    Raises:
        InputError: shapes, NaN, sigma not above zero.

    Source:
        Triggs et al., Bundle adjustment, 2000: Schur complement over points.
    """
    data, start = _bundle_problem(
        cameras, points, image_points, sigma_px, loss, shape_prior, focal_prior, focal_group
    )
    data = replace(data, marginal=marginal)

    result = minimize_lm(
        start,
        cost=lambda bundle: bundle_cost(bundle, data),
        linearize=lambda bundle: _stepper(bundle, data),
        move=move_bundle,
        max_iterations=max_iterations,
        tolerance=tolerance,
    )
    return _adjustment(cameras, image_points, data, result)


def _adjustment(
    starts: Sequence[Camera],
    image_points: Array,
    data: BundleData,
    result: LevenbergMarquardtResult[Bundle],
) -> Adjustment:
    bundle = result.x
    cameras = _cameras(starts, bundle, data)
    projected = np.stack([camera.project(bundle.points) for camera in cameras])
    point_sd, rotation_sd, focal_sd = _deviations(bundle, data)
    return Adjustment(
        cameras=tuple(cameras),
        points=bundle.points,
        coefficients=bundle.coefficients,
        residuals=np.where(data.precision[..., None] > 0, projected - image_points, np.nan),
        cost=result.cost,
        iterations=result.iterations,
        converged=result.converged,
        point_sd_mm=point_sd,
        rotation_sd=rotation_sd,
        focal_sd=focal_sd,
    )


def _stepper(
    bundle: Bundle, data: BundleData
) -> Callable[[float], tuple[tuple[Array, Array], float]]:
    """For a damping, the step from here and the fall of the cost that it promises."""
    system = linearize_bundle(bundle, data)

    def step(damping: float) -> tuple[tuple[Array, Array], float]:
        common, blocks, fall = system.solve(damping)
        return (common, blocks), fall

    return step


def _bundle_problem(
    cameras: Sequence[Camera],
    points: Array,
    image_points: Array,
    sigma_px: float | Array,
    loss: str,
    shape: ShapePrior | None,
    focal: FocalPrior | None,
    group: Array | None,
) -> tuple[BundleData, Bundle]:
    points = check_array("points", points, (None, 3))
    image = check_array("image_points", image_points, (len(cameras), len(points), 2), finite=False)
    seen: Array = np.asarray(np.isfinite(image).all(axis=2))
    sigma = check_array("sigma_px", np.broadcast_to(sigma_px, seen.shape), seen.shape)
    if (sigma <= 0).any():
        raise InputError("sigma_px", "numbers above zero", sigma.min())
    principal = np.stack([camera.principal for camera in cameras])
    groups = _groups(group, len(cameras))
    log_focal = np.log([camera.focal_px for camera in cameras])
    mean, precision = _focal_prior(focal, groups, log_focal)
    if shape is not None:
        shape = _checked_shape(shape, len(points))
    data = BundleData(
        image=np.where(seen[..., None], image - principal[:, None], 0.0),
        precision=np.where(seen, 1 / sigma, 0.0),
        group=groups,
        log_focal_mean=mean,
        log_focal_precision=precision,
        shape=shape,
        loss=loss_named(loss),
    )
    start = Bundle(
        R=np.stack([camera.R_cam_head for camera in cameras]),
        t=np.stack([camera.t_cam_head for camera in cameras]),
        log_focal=_group_means(log_focal, groups),
        points=points,
        coefficients=np.zeros(0 if shape is None else len(shape.components)),
    )
    return data, start


def _checked_shape(shape: ShapePrior, count: int) -> ShapePrior:
    sigma = check_array("shape_prior.sigma", shape.sigma, (count,), finite=False)
    if np.isnan(sigma).any() or (sigma <= 0).any():
        raise InputError("shape_prior.sigma", "numbers above zero", sigma.min())
    return ShapePrior(
        check_array("shape_prior.mean", shape.mean, (count, 3)),
        check_array("shape_prior.components", shape.components, (None, count, 3)),
        sigma,
    )


def _groups(group: Array | None, photos: int) -> Int[Array, " k"]:
    if group is None:
        return np.arange(photos)
    names = check_array("focal_group", group, (photos,), dtype=np.int64)
    return np.unique(names, return_inverse=True)[1].reshape(photos)


def _group_means(values: Array, groups: Int[Array, " k"]) -> Float[Array, " g"]:
    return np.bincount(groups, values) / np.bincount(groups)


def _focal_prior(
    prior: FocalPrior | None, groups: Int[Array, " k"], log_focal: Array
) -> tuple[Float[Array, " g"], Float[Array, " g"]]:
    """Mean and precision of each group's log focal length: its photos' priors combined."""
    photos = len(groups)
    if prior is None:
        return _group_means(log_focal, groups), np.zeros(groups.max() + 1)
    focal = check_array("focal_prior.focal_px", prior.focal_px, (photos,), finite=False)
    deviation = check_array("focal_prior.deviation", prior.deviation, (photos,), finite=False)
    known = np.isfinite(focal) & np.isfinite(deviation)
    if (focal[known] <= 0).any() or (deviation[known] <= 0).any():
        raise InputError("focal_prior", "numbers above zero", "one of 0 or less")
    # One camera's photos carry the same knowledge again, not independent knowledge: the mean
    # of their precisions, not the sum.
    weight = np.where(known, 1 / np.where(known, deviation, 1) ** 2, 0.0)
    total = np.bincount(groups, weight)
    means = np.bincount(groups, weight * np.log(np.where(known, focal, 1.0)))
    count = np.maximum(np.bincount(groups, known), 1)
    return means / np.where(total > 0, total, 1), np.sqrt(total / count)


def _cameras(starts: Sequence[Camera], bundle: Bundle, data: BundleData) -> list[Camera]:
    return [
        replace(
            camera,
            focal_px=float(np.exp(bundle.log_focal[data.group[k]])),
            R_cam_head=bundle.R[k],
            t_cam_head=bundle.t[k],
        )
        for k, camera in enumerate(starts)
    ]


def _deviations(bundle: Bundle, data: BundleData) -> tuple[Array, Array, Array]:
    """Standard deviations of the points, rotations and log focal lengths at the solution."""
    photos = len(bundle.R)
    system = linearize_bundle(bundle, data)
    constraints = None
    if data.shape is None:
        constraints = similarity_constraints(bundle.points, ~system.open_blocks())
    try:
        common, blocks = system.covariance(constraints)
    except EstimationError:
        return np.full(len(bundle.points), np.inf), np.full(photos, np.inf), np.full(photos, np.inf)
    variance = np.diagonal(common)
    turns = variance[: POSE_SIZE * photos].reshape(photos, POSE_SIZE)[:, :3].sum(axis=1)
    focals = variance[POSE_SIZE * photos :][data.group]
    return np.sqrt(np.trace(blocks, axis1=1, axis2=2)), np.sqrt(turns), np.sqrt(focals)
