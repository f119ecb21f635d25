"""All cameras, the shape and the places on it at once.

The places X_n = mean_n + sum_c c_c B_cn + d_n of the surface are unknown, with Gaussian beliefs
about the coefficients c and the deviations d. Least squares over cameras and places together is
biased where views are nearly affine: turning the cameras further apart flattens the shape, and
with it every deviation from the prior, so that the turn grows without bound (48 degrees became 85
on two real photos; docs/method/registration.md).
The cure is that of regression with noisy regressors,
instrumental variables: the equations of the cameras weigh the residuals with derivatives taken at
the prior's mean, which does not know the deviations, instead of at the estimated places, which do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.reconstruction.dense.joint_equations import linearize, solve_rows
from mien.reconstruction.dense.joint_points import (
    JointProblem,
    matching_noise,
    misfit_at,
    settle_places,
)
from mien.reconstruction.dense.joint_problem import (
    POSE,
    CameraPrior,
    JointState,
    Lenses,
    PlacePrior,
    Sightings,
    cameras_at,
    start_state,
)

__all__ = [
    "JointSolution",
    "Lenses",
    "PlacePrior",
    "Sightings",
    "matching_noise",
    "solve_jointly",
]

_LONGEST_STEP = 0.3
"""Radians, or relative change of depth and focal length: beyond, linear steps mean nothing."""
_SETTLING = 2
"""Steps of the places alone after each common step: without them, places that lag behind their
cameras drive the next step astray, and the iteration can diverge."""


@dataclass(frozen=True)
class JointSolution:
    """Cameras, shape and places of highest posterior.

    Attributes:
        cameras: one a photo.
        problem: what was asked, and the unknowns' values.
        state: what was asked, and the unknowns' values.
        converged: whether the last step was next to nothing.
    """

    cameras: tuple[Camera, ...]
    problem: JointProblem
    state: JointState
    converged: bool

    @property
    def coefficients(self) -> Float[Array, " c"]:
        """(C,) of the prior's components."""
        return self.state.coefficients

    @property
    def places(self) -> Float[Array, "n 3"]:
        """(N, 3) mm."""
        return self.state.places

    @cached_property
    def off_sigmas(self) -> Float[Array, " m"]:
        """(M,) length of each residual over its sigma."""
        residuals = misfit_at(self.problem, self.state).residuals
        return np.linalg.norm(residuals, axis=1) / self.problem.seen.sigma_px

    @cached_property
    def covariance(self) -> Float[Array, "q q"]:
        """(6K + G + C) square, of poses, log focal lengths and coefficients, places integrated out.

        The inverse of the symmetric equations; a pose's unknowns are rotation vector, x and y
        (mm) and log depth.
        """
        matrix = linearize(self.problem, self.state, instruments=False)[0].matrix
        scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-12))
        scaled = matrix * np.outer(scale, scale)
        inverse: Array = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
        return inverse * np.outer(scale, scale)


def solve_jointly(
    cameras: Sequence[Camera],
    places: Float[Array, "n 3"],
    sightings: Sightings,
    prior: PlacePrior,
    lenses: Lenses,
    *,
    anchors: Float[Array, "k 3 3"] | None = None,
    instruments: bool = True,
    iterations: int = 12,
    tolerance: float = 3e-4,
) -> JointSolution:
    """Gauss-Newton steps with Cauchy weights, the places eliminated from every step.

    Args:
        cameras: K starts.
        places: (N, 3) mm start.
        anchors: (K, 3, 3) R_cam_head that the rotations are believed to lie about; those of the
            starts unless given.
        instruments: against the bias; without them the solution is that of lowest cost.
        tolerance: radians and relative changes below which a step is next to nothing.

    Raises:
        EstimationError: the equations have no solution.
    """
    state = start_state(cameras, places, lenses, len(prior.components))
    believed = CameraPrior(state.R if anchors is None else anchors, state.t, lenses)
    problem = JointProblem(cameras, sightings, prior, believed)
    converged = False
    for _ in range(iterations):
        state, size = _step(problem, state, instruments)
        converged = size < tolerance
        if converged:
            break
    return JointSolution(cameras_at(state, cameras, lenses), problem, state, converged)


def _step(problem: JointProblem, state: JointState, instruments: bool) -> tuple[JointState, float]:
    """The state after a step, and the step's largest rotation or relative change."""
    rows, answer = linearize(problem, state, instruments=instruments)
    common = solve_rows(rows)
    count = POSE * len(state.R)
    poses = common[:count].reshape(-1, POSE)
    focal = common[count : count + len(state.log_focal)]
    size = float(np.abs(np.concatenate([poses[:, :3].ravel(), poses[:, 5], focal])).max())
    share = min(1.0, _LONGEST_STEP / max(size, 1e-12))
    moved = state.moved(common, answer.step(common), share)
    for _ in range(_SETTLING):
        moved = settle_places(problem, moved)
    return moved, size
