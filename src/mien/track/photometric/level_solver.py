"""Levenberg-Marquardt over pose and face on one pyramid level.

Source:
    [Pighin 2002] sec. 6.1.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.numeric.solvers.levenberg_marquardt import minimize_lm
from mien.track.face_model import FaceModel
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.linearization import ImagePair, Linearization
from mien.track.photometric.normal_equations import NormalEquations
from mien.track.photometric.range_penalty import range_penalty

EFFECTIVE_OBSERVATIONS = 2000.0
"""How many independent observations a face's pixels are worth: errors of neighbours correlate."""
RANGE_PENALTY = 200.0
"""c of [Pighin 2002]'s D(p), in units of the cost: a weight that is 0.1 out of range costs 2."""
_MIN_NOISE = 0.5
"""Grey levels: the smallest standard deviation of the residual that is assumed."""


@dataclass(frozen=True)
class LevelSolution:
    """The parameters of least cost on one level.

    Attributes:
        parameters: of least cost.
        linearization: of the level, around the start.
        matrix: (N, N) of the pixels' normal equations, in units of the cost.
        prior: as it was given.
        free: (N,) which unknowns were solved for.
        iterations: linearizations made.
        rms: grey levels, of the pixels' weighted residual.
    """

    parameters: Parameters
    linearization: Linearization
    matrix: Float[Array, "n n"]
    prior: GaussianPrior
    free: Bool[Array, " n"]
    iterations: int
    rms: float

    @cached_property
    def image_pair(self) -> ImagePair:
        """Face and frame at these parameters."""
        return self.linearization.image_pair(self.parameters)

    @cached_property
    def information(self) -> Float[Array, "m m"]:
        """(M, M) inverse covariance of the free unknowns, from picture and prior."""
        # Without D(p): a weight at the end of its range is not known better for that.
        own = self.matrix[np.ix_(self.free, self.free)]
        return own + np.diag(self.prior.deviations[self.free] ** -2.0)

    @property
    def deviations(self) -> Float[Array, " n"]:
        """(N,) of the unknowns; the prior's for those that were not free."""
        deviations = self.prior.deviations.copy()
        deviations[self.free] = np.sqrt(np.diag(np.linalg.inv(self.information)))
        return deviations


def solve_level(
    linearization: Linearization,
    prior: GaussianPrior,
    *,
    free: Bool[Array, " n"],
    iterations: int,
    tolerance: float,
) -> LevelSolution:
    """The free unknowns of least cost, by [Pighin 2002] eq. (6); damped by the diagonal.

    The cost is the squared residual of the pixels over the noise variance at the start, scaled to
    EFFECTIVE_OBSERVATIONS, plus half the squared distance from the prior's mean, plus D(p).

    Args:
        linearization: of the level, around the start.
        prior: of the parameters.
        free: (N,) which unknowns are solved for.
        iterations: at most (numeric.solvers.levenberg_marquardt).
        tolerance: of the cost (numeric.solvers.levenberg_marquardt).
    """
    problem = _Problem(linearization, prior, free)
    result = minimize_lm(
        linearization.parameters,
        cost=problem.cost,
        linearize=problem.linearize,
        move=Parameters.plus,
        max_iterations=iterations,
        tolerance=tolerance,
        max_failures=1,
    )
    found, _ = problem.at(result.x)
    rms = float(np.sqrt(found.squares / max(found.weight, 1e-9)))
    matrix = problem.scale(found) * found.matrix
    return LevelSolution(result.x, linearization, matrix, prior, free, result.iterations, rms)


class _Problem:
    """Cost and normal equations as minimize_lm asks for them."""

    def __init__(
        self, linearization: Linearization, prior: GaussianPrior, free: Bool[Array, " n"]
    ) -> None:
        self._linearization, self._prior, self._free = linearization, prior, free
        # The last two only: the loop goes back to the one before when a step fails.
        self._cache: dict[int, tuple[Parameters, NormalEquations, _PriorTerms]] = {}
        first, _ = self.at(linearization.parameters)
        noise = max(first.squares / max(first.weight, 1e-9), _MIN_NOISE**2)
        self._weight = (
            first.weight * min(1.0, EFFECTIVE_OBSERVATIONS / linearization.level.face_px**2) / noise
        )

    def at(self, x: Parameters) -> tuple[NormalEquations, _PriorTerms]:
        """Normal equations of the pixels, and the prior's part."""
        if id(x) not in self._cache:
            while len(self._cache) > 1:
                del self._cache[next(iter(self._cache))]
            # With the parameters themselves: an id is unique only while its object exists.
            terms = _prior_terms(self._linearization.level.model, x, self._prior)
            self._cache[id(x)] = (x, self._linearization.normal_equations(x), terms)
        return self._cache[id(x)][1:]

    def scale(self, found: NormalEquations) -> float:
        """Of the pixels' cost: it must not change with the number of pixels in the frame."""
        return self._weight / max(found.weight, 1e-9)

    def cost(self, x: Parameters) -> float:
        found, terms = self.at(x)
        return self.scale(found) * found.squares / 2 + terms.value

    def linearize(self, x: Parameters) -> Callable[[float], tuple[Array, float]]:
        found, terms = self.at(x)
        factor, free = self.scale(found), self._free
        matrix = (factor * found.matrix + terms.hessian)[np.ix_(free, free)]
        downhill = (factor * found.vector - terms.gradient)[free]
        diagonal = np.diag(matrix)

        def step(damping: float) -> tuple[Array, float]:
            found = np.linalg.solve(matrix + np.diag(damping * diagonal), downhill)
            whole = np.zeros(len(free))
            whole[free] = found
            return whole, float(found @ (damping * diagonal * found + downhill)) / 2

        return step


class _PriorTerms(NamedTuple):
    """The prior's cost and D(p), with derivatives.

    Attributes:
        value: >= 0.
        gradient: (N,).
        hessian: (N, N).
    """

    value: float
    gradient: Float[Array, " n"]
    hessian: Float[Array, "n n"]


def _prior_terms(model: FaceModel, parameters: Parameters, prior: GaussianPrior) -> _PriorTerms:
    off, precision = parameters.minus(prior.mean), prior.deviations**-2.0
    value, gradient, hessian = float(precision @ off**2) / 2, precision * off, np.diag(precision)
    limits = model.limits
    limited = limits.directions @ parameters.face.vector + limits.offset
    penalty = range_penalty(limited, RANGE_PENALTY, limits.directions)
    if penalty is not None:
        value += penalty.value
        gradient[POSE_UNKNOWNS:] += penalty.gradient
        hessian[POSE_UNKNOWNS:, POSE_UNKNOWNS:] += penalty.hessian
    return _PriorTerms(value, gradient, hessian)
