"""All cameras, the shape and the points on it at once, by Gauss-Newton with instrumental variables.

Least squares over cameras and points together is biased where views are nearly affine: turning the
cameras further apart flattens the shape, and with it every deviation from the prior, so that the
turn grows without bound (48 degrees became 85 on two real photos; docs/method/registration.md).
It is the bias of regression with noisy regressors, and instrumental variables remove it: the
equations of the cameras weigh the residuals with derivatives taken at the prior's mean, which does
not depend on the points' deviations, instead of at the estimated points. They are no gradient of a
cost, which is why this solver is not bundle.adjustment's.

The gauge is fixed by the priors alone. The camera equations with instruments do not know that, and
their noise would drive head and cameras away together. So those of their linear combinations are
kept that change the images otherwise than gauge motions do, and seven others say that no gauge
motion brings cameras and points nearer to their priors' means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.errors import EstimationError
from mien.reconstruction.bundle.gauge import GaugeMotions, gauge_motions
from mien.reconstruction.bundle.problem import (
    BundleProblem,
    BundleState,
    CameraPrior,
    FocalGroups,
    Observations,
    PointPrior,
    apply_each,
)
from mien.reconstruction.bundle.projection import POSE_SIZE, Reprojection

__all__ = [
    "INDEPENDENT_POINTS",
    "POSE_DEVIATION",
    "JointSolution",
    "noise_factor",
    "noise_variance",
    "reprojection",
    "solve_jointly",
]

POSE_DEVIATION = np.array([0.1, 0.1, 0.1, 30.0, 30.0, 0.6])
"""Of a camera from where landmarks put it: rotation (rad); x and y (mm), log depth."""
_EXPECTED_MEDIAN = 0.5
"""Of the residuals over their sigmas, where matches are as good as on sharp photos. Where they are
not (small, compressed or moving faces), all sigmas grow until it is met."""
INDEPENDENT_POINTS = 150
"""What the prior does not express, and what differs between photos, goes together over 15 to 20 mm
of skin: however many points are followed on a face, they are no more than so many."""
_MAX_STEP = 0.3
"""Radians, or relative change of depth and focal length: beyond, linear steps mean nothing."""
_POINT_STEPS = 2
"""Steps of the points alone after each common step: without them, points that lag behind their
cameras drive the next step astray, and the iteration can diverge."""
_MOVING = 1e-6
"""A gauge motion that moves the images by less than this fraction of another moves no camera."""


@dataclass(frozen=True)
class JointSolution:
    """Cameras, shape and points.

    Attributes:
        cameras: one a photo.
        problem: what was solved.
        state: values of the unknowns.
        converged: whether the last step was below the tolerance.
    """

    cameras: tuple[Camera, ...]
    problem: BundleProblem
    state: BundleState
    converged: bool

    @cached_property
    def normalized_residuals(self) -> Float[Array, " m"]:
        """(M,) length of each residual over its sigma."""
        residuals = reprojection(self.problem, self.state).residuals
        return np.linalg.norm(residuals, axis=1) / self.problem.observations.sigma_px

    @cached_property
    def covariance(self) -> Float[Array, "q q"]:
        """(6K + G + C) square, of poses, log focal lengths and coefficients, points integrated out.

        The inverse of the normal equations of least squares; a pose's parameters are rotation
        vector, x and y (mm) and log depth.
        """
        at = reprojection(self.problem, self.state)
        matrix, _ = self.problem.normal_equations(self.state, at).reduced()
        scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-12))
        scaled = matrix * np.outer(scale, scale)
        inverse: Array = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
        return inverse * np.outer(scale, scale)


def solve_jointly(
    cameras: Sequence[Camera],
    points: Float[Array, "n 3"],
    observations: Observations,
    prior: PointPrior,
    focal: FocalGroups,
    *,
    prior_rotations: Float[Array, "k 3 3"] | None = None,
    instruments: bool = True,
    iterations: int = 12,
    tolerance: float = 3e-4,
) -> JointSolution:
    """Gauss-Newton steps with Cauchy weights, the points eliminated from every step.

    Args:
        cameras: K initial values.
        points: (N, 3) mm, initial values.
        observations: of the points.
        prior: of the points.
        focal: which photos share a focal length, and their priors.
        prior_rotations: (K, 3, 3) R_cam_head, means of the rotations' prior; the initial ones
            unless given.
        instruments: against the bias; without them the solution is that of least squares.
        iterations: at most.
        tolerance: radians and relative changes below which a step has converged.

    Raises:
        EstimationError: the equations have no solution.
    """
    state = BundleState.of(cameras, points, focal.group, len(prior.components))
    rotations = state.R if prior_rotations is None else prior_rotations
    camera_prior = CameraPrior(rotations, state.t, focal, POSE_DEVIATION)
    problem = BundleProblem(cameras, observations, prior, camera_prior)
    converged = False
    for _ in range(iterations):
        state, size = _step(problem, state, instruments)
        converged = size < tolerance
        if converged:
            break
    return JointSolution(state.cameras(cameras, focal.group), problem, state, converged)


def reprojection(problem: BundleProblem, state: BundleState) -> Reprojection:
    """Residuals with Cauchy weights, whose sigmas grow with the noise of the matches."""
    projection = problem.project(state, state.points)
    residuals = projection.image_points - problem.image
    squared = (residuals**2).sum(axis=1)
    variance, matches = problem.observations.sigma_px**2, problem.observations.for_cameras
    noise = noise_factor(np.sqrt(squared / variance)[matches])
    weights = 1 / (variance * np.where(matches, noise**2, 1.0) + squared)
    return Reprojection(projection, residuals, weights)


def noise_factor(normalized_residuals: Float[Array, " m"]) -> float:
    """How many times their sigmas the errors of matches are, at least 1."""
    median = float(np.median(normalized_residuals)) if len(normalized_residuals) else 0.0
    return max(1.0, median / _EXPECTED_MEDIAN)


def noise_variance(normalized_residuals: Float[Array, " m"], points: int) -> float:
    """By how much the variance of matches of so many points is larger than their sigmas say.

    What exceeds the sigmas is no error of single matches but of what the photos show: skin that
    moved, light, hair. Its neighbours share it, so that many points tell no more than few.
    """
    excess = noise_factor(normalized_residuals) ** 2 - 1
    return 1 + excess * max(1.0, points / INDEPENDENT_POINTS)


def solve_equations(matrix: Float[Array, "q q"], right: Float[Array, " q"]) -> Float[Array, " q"]:
    """The solution, rows and columns scaled.

    Raises:
        EstimationError: there is none.
    """
    by_row = 1 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
    scaled = by_row[:, None] * matrix
    by_column = 1 / np.maximum(np.abs(scaled).max(axis=0), 1e-300)
    try:
        step: Array = by_column * np.linalg.solve(scaled * by_column, by_row * right)
    except np.linalg.LinAlgError as error:
        raise EstimationError(f"the photos do not determine cameras and shape ({error})") from error
    if not np.isfinite(step).all():
        raise EstimationError("the photos do not determine cameras and shape")
    return step


def _step(
    problem: BundleProblem, state: BundleState, instruments: bool
) -> tuple[BundleState, float]:
    """The state after a step, and the step's largest rotation or relative change."""
    at = reprojection(problem, state)
    system = problem.normal_equations(state, at)
    matrix, right = system.reduced()
    if instruments:
        own = system.eliminate(*_camera_equations(problem, state, at, system.common))
        matrix[: len(own[0])], right[: len(own[1])] = own
    common = solve_equations(matrix, right)
    count = POSE_SIZE * len(state.R)
    poses = common[:count].reshape(-1, POSE_SIZE)
    focal = common[count : count + len(state.log_focal)]
    size = float(np.abs(np.concatenate([poses[:, :3].ravel(), poses[:, 5], focal])).max())
    moved = state.moved(common, system.block_step(common), min(1.0, _MAX_STEP / max(size, 1e-12)))
    for _ in range(_POINT_STEPS):
        moved = _with_points_moved(problem, moved)
    return moved, size


def _with_points_moved(problem: BundleProblem, state: BundleState) -> BundleState:
    """The state after a Gauss-Newton step of the points alone."""
    blocks = problem.point_blocks(state, reprojection(problem, state))
    step = apply_each(np.linalg.inv(blocks.information), blocks.gradient)
    return replace(state, points=state.points - step)


_Equations = tuple[Float[Array, "a q"], Float[Array, "n a 3"], Float[Array, " a"]]
"""matrix @ common + sum coupling_n @ points_n = right: matrix, coupling, right."""


def _camera_equations(
    problem: BundleProblem, state: BundleState, at: Reprojection, least_squares: Float[Array, "q q"]
) -> _Equations:
    """As many as the cameras have unknowns: with instruments, the gauge fixed by the priors.

    Args:
        problem: to be solved.
        state: at which they are linearized.
        at: its reprojection errors.
        least_squares: (Q, Q) the common part of the normal equations.
    """
    size = len(problem.camera_prior.precision)
    instruments = problem.project(state, problem.point_prior.mean).camera_jacobian()
    instruments *= problem.observations.for_cameras[:, None, None]
    own, coupling, gradient = problem.camera_equations(state, at, instruments)
    matrix = np.pad(own, ((0, 0), (0, len(least_squares) - size)))
    motions = gauge_motions(state)
    kept, moving = _split(least_squares[:size, :size], motions)
    gauge = _gauge_equations(problem, state, motions)
    return (
        np.concatenate([kept @ matrix, moving @ gauge[0]]),
        np.concatenate([kept @ coupling, moving @ gauge[1]], axis=1),
        np.append(kept @ -gradient, moving @ gauge[2]),
    )


def _split(
    information: Float[Array, "d d"], motions: GaugeMotions
) -> tuple[Float[Array, "e d"], Float[Array, "f 7"]]:
    """The cameras' unknowns split into gauge motions and other directions.

    Directions that change the images otherwise than gauge motions do, and combinations of the gauge
    motions that move cameras.

    A longer lens farther away is one of the former, though the depth alone is nearly the gauge's
    scale. One photo's camera does not move when the head grows away from it.

    Args:
        information: of the cameras' unknowns, least squares.
        motions: at the same state.
    """
    strength = np.sqrt(np.diagonal(information))
    moved = (information @ motions.cameras) / strength[:, None]
    size = np.linalg.norm(moved, axis=0)
    axes, stretch, combinations = np.linalg.svd(moved / size)
    moving = np.count_nonzero(stretch > _MOVING * stretch[0])
    return axes[:, moving:].T / strength, combinations[:moving] / size


def _gauge_equations(
    problem: BundleProblem, state: BundleState, motions: GaugeMotions
) -> _Equations:
    """No gauge motion brings the unknowns nearer to their priors' means.

    sum P (d + x - B c) along each motion, and the same of the cameras, is 0.
    """
    prior, precision = problem.point_prior, problem.camera_prior.precision
    by_point = prior.precision @ motions.points
    by_camera = motions.cameras.T * precision
    flat = by_point.reshape(-1, by_point.shape[2])
    right = -by_camera @ problem.camera_prior.deviations(state)
    right -= flat.T @ problem.point_deviations(state).ravel()
    matrix = np.concatenate([by_camera, -flat.T @ problem.basis], axis=1)
    return matrix, np.swapaxes(by_point, 1, 2), right
