"""Joint bundle adjustment of cameras and points, with what is known of the shape beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.camera import Camera
from mien.errors import EstimationError, InputError
from mien.numeric.solvers.levenberg_marquardt import minimize_lm
from mien.numeric.solvers.robust import Loss, loss_named
from mien.numeric.solvers.schur import BlockSystem
from mien.reconstruction.bundle.gauge import similarity_constraints
from mien.reconstruction.bundle.marginal_likelihood import point_evidence
from mien.reconstruction.bundle.problem import (
    BundleProblem,
    BundleState,
    CameraPrior,
    FocalGroups,
    Observations,
    PointPrior,
    apply_each,
)
from mien.reconstruction.bundle.projection import (
    CAMERA_SIZE,
    POSE_SIZE,
    PinholeArrays,
    Projection,
    Reprojection,
)

__all__ = ["Adjustment", "FocalPrior", "Posterior", "ShapePrior", "adjust_bundle"]


@dataclass(frozen=True)
class ShapePrior:
    """Gaussian prior of the shape: m_i = mean_i + sum_c c B_ci + d_i.

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
class FocalPrior:
    """What is known of the focal lengths.

    Attributes:
        focal_px: (K,) expected; NaN where nothing is known.
        deviation: (K,) standard deviation of log(focal), about the relative error.
    """

    focal_px: Float[Array, " k"]
    deviation: Float[Array, " k"]


@dataclass(frozen=True)
class DistancePrior:
    """What is known of the cameras' distances, log-normal; of use with a shape prior's scale only.

    Attributes:
        median_mm: of t_z.
        deviation: standard deviation of its logarithm.
    """

    median_mm: float
    deviation: float


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
        point_sd_mm: (N,) standard deviation of a point (all three axes together) at the given
            sigma_px and priors, as are the next two. Infinite where the data leave it open. Without
            a shape prior, after the points observed twice are aligned by a similarity.
        rotation_sd: (K,) radians.
        focal_sd: (K,) relative.
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
    distance_prior: DistancePrior | None = None,
    marginal: bool = True,
    max_iterations: int = 200,
    tolerance: float = 1e-10,
) -> Adjustment:
    """Minimizes reprojection error and priors over all cameras and points at once.

    Principal points stay. Without a shape prior a common similarity of cameras and points changes
    nothing, and the solution stays near the start's frame and scale; with one, the prior's frame
    and scale (63 mm between the pupils) decide. A point that neither two photos nor the prior
    determine moves as little as the fit allows.

    Args:
        cameras: K initial values, from recover_pose.
        points: (N, 3) mm, initial values.
        image_points: (K, N, 2) px, NaN where unseen.
        sigma_px: standard deviation of an observation per axis, one number or (K, N).
        loss: "linear", "huber" or "cauchy", for observations of which some are wrong.
        shape_prior: of the points; None where nothing is known.
        focal_prior: of the focal lengths; None where nothing is known.
        focal_group: (K,) photos with the same number share their focal length.
        distance_prior: of each camera; None where nothing is known.
        marginal: with a shape prior, find the cameras of highest probability with the points
            integrated out, not with the most probable points (bundle.marginal_likelihood).
        max_iterations: of the Levenberg-Marquardt solver.
        tolerance: relative fall of the cost at which it has converged.

    Raises:
        InputError: shapes, NaN, sigma not above zero.

    Source:
        Triggs et al., Bundle adjustment, 2000: Schur complement over points.
    """
    points = check_array("points", points, (None, 3))
    image = check_array("image_points", image_points, (len(cameras), len(points), 2), finite=False)
    observed: Array = np.asarray(np.isfinite(image).all(axis=2))
    sigma = check_array("sigma_px", np.broadcast_to(sigma_px, observed.shape), observed.shape)
    if (sigma <= 0).any():
        raise InputError("sigma_px", "numbers above zero", sigma.min())
    groups = _focal_groups(focal_prior, focal_group, cameras)
    shape = _checked_shape(shape_prior, len(points))
    photo, point = np.nonzero(observed)
    posterior = Posterior(
        BundleProblem(
            cameras,
            Observations(photo, point, image[observed], sigma[observed], np.ones(len(photo), bool)),
            PointPrior(shape.mean, shape.components, np.eye(3) / shape.sigma[:, None, None] ** 2),
            camera_prior(cameras, groups, distance_prior),
        ),
        loss_named(loss),
        shape.sigma if marginal and shape_prior is not None else None,
    )
    result = minimize_lm(
        BundleState.of(cameras, points, groups.group, len(shape.components)),
        cost=posterior.cost,
        linearize=posterior.stepper,
        move=lambda state, step: state.moved(*step),
        max_iterations=max_iterations,
        tolerance=tolerance,
    )
    adjusted = result.x.cameras(cameras, groups.group)
    projected = np.stack([camera.project(result.x.points) for camera in adjusted])
    point_sd, rotation_sd, focal_sd = _standard_deviations(
        posterior, result.x, fixed_gauge=shape_prior is None
    )
    return Adjustment(
        cameras=adjusted,
        points=result.x.points,
        coefficients=result.x.coefficients,
        residuals=np.where(observed[..., None], projected - image, np.nan),
        cost=result.cost,
        iterations=result.iterations,
        converged=result.converged,
        point_sd_mm=point_sd,
        rotation_sd=rotation_sd,
        focal_sd=focal_sd,
    )


@dataclass(frozen=True)
class Posterior:
    """Minus the logarithm of the posterior of a bundle adjustment problem, up to a constant.

    Attributes:
        problem: of which every point has the same precision along all axes.
        loss: robust loss of squared residuals over their variance.
        integrated_sd: (N,) mm, the points' prior deviations, to integrate over their positions
            (bundle.marginal_likelihood); None to take the most probable ones.
    """

    problem: BundleProblem
    loss: Loss
    integrated_sd: Float[Array, " n"] | None

    def cost(self, state: BundleState) -> float:
        """Infinite with an observed point behind its camera."""
        try:
            residuals = self._residuals(self.problem.project(state, state.points))
        except EstimationError:
            return np.inf
        problem = self.problem
        cost = self.loss(self._squared(residuals))[0].sum() + (state.coefficients**2).sum()
        cost += (problem.camera_prior.precision * problem.camera_prior.deviations(state) ** 2).sum()
        off = problem.point_deviations(state)
        cost += (off * apply_each(problem.point_prior.precision, off)).sum()
        return 0.5 * float(cost) + self._log_determinants(state)[0]

    def normal_equations(self, state: BundleState) -> BlockSystem:
        """Robust terms enter by their weights, the integral by its gradient."""
        projection = self.problem.project(state, state.points)
        residuals = self._residuals(projection)
        weights = self.loss(self._squared(residuals))[1] / self.problem.observations.sigma_px**2
        system = self.problem.normal_equations(state, Reprojection(projection, residuals, weights))
        gradient = self._log_determinants(state)[1]
        by_unknown = self.problem.camera_prior.focal.sum_by_unknown(gradient)
        system.common_gradient[: len(by_unknown)] += by_unknown
        return system

    def stepper(self, state: BundleState) -> Callable[[float], tuple[tuple[Array, Array], float]]:
        """For a damping, the step from here and the fall of the cost that it predicts."""
        system = self.normal_equations(state)

        def step(damping: float) -> tuple[tuple[Array, Array], float]:
            common, points, fall = system.solve(damping)
            return (common, points), fall

        return step

    def _residuals(self, projection: Projection) -> Float[Array, "m 2"]:
        return projection.image_points - self.problem.image

    def _squared(self, residuals: Float[Array, "m 2"]) -> Float[Array, " m"]:
        """In units of the observations' variance."""
        return (residuals**2).sum(axis=1) / self.problem.observations.sigma_px**2

    def _log_determinants(self, state: BundleState) -> tuple[float, Float[Array, "k 7"]]:
        """What the integral adds to the cost, and its gradient.

        Functions of the cameras alone, since the points are taken at the prior's mean.
        """
        if self.integrated_sd is None:
            return 0.0, np.zeros((len(state.R), CAMERA_SIZE))
        seen, focal = self.problem.observations, self.problem.camera_prior.focal
        precision = np.zeros((len(state.R), len(state.points)))
        precision[seen.photo, seen.point] = 1 / seen.sigma_px
        focal_px = np.exp(state.log_focal)[focal.group]
        mean = self.problem.point_prior.mean
        return point_evidence(state.R, state.t, focal_px, precision, mean, self.integrated_sd)


def camera_prior(
    cameras: Sequence[Camera], groups: FocalGroups, distance: DistancePrior | None = None
) -> CameraPrior:
    """A prior that knows the focal lengths, perhaps the distances, and nothing else."""
    arrays = PinholeArrays.of(cameras)
    deviation = np.full(POSE_SIZE, np.inf)
    if distance is None:
        return CameraPrior(arrays.R, arrays.t, groups, deviation)
    # What is known of one distance is known of all: photos of one person share photographer and
    # lens, and many of them know no more than one.
    deviation[-1] = distance.deviation * np.sqrt(len(cameras))
    mean = np.column_stack([arrays.t[:, :2], np.full(len(cameras), distance.median_mm)])
    return CameraPrior(arrays.R, mean, groups, deviation)


def _checked_shape(shape: ShapePrior | None, count: int) -> ShapePrior:
    if shape is None:
        return ShapePrior(np.zeros((count, 3)), np.zeros((0, count, 3)), np.full(count, np.inf))
    sigma = check_array("shape_prior.sigma", shape.sigma, (count,), finite=False)
    if np.isnan(sigma).any() or (sigma <= 0).any():
        raise InputError("shape_prior.sigma", "numbers above zero", sigma.min())
    return ShapePrior(
        check_array("shape_prior.mean", shape.mean, (count, 3)),
        check_array("shape_prior.components", shape.components, (None, count, 3)),
        sigma,
    )


def _focal_groups(
    prior: FocalPrior | None, group: Array | None, cameras: Sequence[Camera]
) -> FocalGroups:
    """Prior of each group's log focal length: its photos' priors combined."""
    photos = len(cameras)
    names = np.arange(photos) if group is None else group
    names = check_array("focal_group", names, (photos,), dtype=np.int64)
    groups = np.unique(names, return_inverse=True)[1].reshape(photos)
    if prior is None:
        log_focal = np.log([camera.focal_px for camera in cameras])
        mean = np.bincount(groups, log_focal) / np.bincount(groups)
        return FocalGroups(groups, mean, np.full(len(mean), np.inf))
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
    with np.errstate(divide="ignore"):
        return FocalGroups(groups, means / np.where(total > 0, total, 1), np.sqrt(count / total))


def _standard_deviations(
    posterior: Posterior, state: BundleState, *, fixed_gauge: bool
) -> tuple[Array, Array, Array]:
    """Standard deviations of the points, rotations and log focal lengths at the solution."""
    photos = len(state.R)
    system = posterior.normal_equations(state)
    constraints = None
    if fixed_gauge:
        constraints = similarity_constraints(state.points, ~system.open_blocks())
    try:
        common, blocks = system.covariance(constraints)
    except EstimationError:
        return np.full(len(state.points), np.inf), np.full(photos, np.inf), np.full(photos, np.inf)
    variance = np.diagonal(common)
    rotations = variance[: POSE_SIZE * photos].reshape(photos, POSE_SIZE)[:, :3].sum(axis=1)
    focals = variance[POSE_SIZE * photos :][posterior.problem.camera_prior.focal.group]
    return np.sqrt(np.trace(blocks, axis1=1, axis2=2)), np.sqrt(rotations), np.sqrt(focals)
