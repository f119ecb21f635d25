"""Pose, then expression, by Levenberg-Marquardt on one size of a picture.

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
from mien.track.face_model import TrackedFace
from mien.track.parameters import Belief, Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.linearization import Look, Pictures
from mien.track.photometric.normal_equations import Equations
from mien.track.photometric.range_penalty import range_penalty

SAY = 2000.0
"""How many independent observations a face's pixels are, however many: neighbours err alike."""
LIMIT = 200.0
"""c of [Pighin 2002]'s D(p), in units of the cost: a weight that is 0.1 out of range costs 2."""
_LEAST_NOISE = 0.5
"""Grey levels: nothing is believed to be drawn better than this."""


@dataclass(frozen=True)
class Answer:
    """What a phase found.

    Attributes:
        guess: of least cost.
        look: at the scene, around the start.
        matrix: (N, N) of the pixels' normal equations, in units of the cost.
        belief: as it was given.
        free: (N,) which unknowns were solved for.
        iterations: linearizations made.
        rms: grey levels, of the pixels' weighted residual.
    """

    guess: Guess
    look: Look
    matrix: Float[Array, "n n"]
    belief: Belief
    free: Bool[Array, " n"]
    iterations: int
    rms: float

    @cached_property
    def pictures(self) -> Pictures:
        """Of the guess."""
        return self.look.pictures(self.guess)

    @cached_property
    def information(self) -> Float[Array, "m m"]:
        """(M, M) inverse covariance of the free unknowns, given picture and belief."""
        # Without D(p): that a weight is at the end of its range says nothing of how sure it is.
        own = self.matrix[np.ix_(self.free, self.free)]
        return own + np.diag(self.belief.deviations[self.free] ** -2.0)

    @property
    def deviations(self) -> Float[Array, " n"]:
        """(N,) of the unknowns; the belief's own for those that were not free."""
        deviations = self.belief.deviations.copy()
        deviations[self.free] = np.sqrt(np.diag(np.linalg.inv(self.information)))
        return deviations


def solve(
    look: Look, belief: Belief, *, free: Bool[Array, " n"], iterations: int, tolerance: float
) -> Answer:
    """The free unknowns of least cost, by [Pighin 2002] eq. (6); damped by the diagonal.

    The cost is the squared residual of the pixels, in units of the noise that the first guess
    leaves and counted as SAY observations in all, plus half the squared distance from the belief,
    plus D(p).

    Args:
        look: gives the pixels' equations, and the first guess.
        iterations: where to stop (numeric.solvers.levenberg_marquardt).
        tolerance: where to stop (numeric.solvers.levenberg_marquardt).
    """
    problem = _Problem(look, belief, free)
    result = minimize_lm(
        look.guess,
        cost=problem.cost,
        linearize=problem.linearize,
        move=Guess.moved,
        max_iterations=iterations,
        tolerance=tolerance,
        max_failures=1,
    )
    found, _ = problem.at(result.x)
    rms = float(np.sqrt(found.squares / max(found.weight, 1e-9)))
    matrix = problem.scale(found) * found.matrix
    return Answer(result.x, look, matrix, belief, free, result.iterations, rms)


class _Problem:
    """Cost and normal equations as minimize_lm asks for them."""

    def __init__(self, look: Look, belief: Belief, free: Bool[Array, " n"]) -> None:
        self._look, self._belief, self._free = look, belief, free
        # The last two only: the loop goes back to the one before when a step fails.
        self._seen: dict[int, tuple[Guess, Equations, _Prior]] = {}
        first, _ = self.at(look.guess)
        noise = max(first.squares / max(first.weight, 1e-9), _LEAST_NOISE**2)
        self._say = first.weight * min(1.0, SAY / look.scene.face_px**2) / noise

    def at(self, x: Guess) -> tuple[Equations, _Prior]:
        """Equations of the pixels, and what was believed."""
        if id(x) not in self._seen:
            while len(self._seen) > 1:
                del self._seen[next(iter(self._seen))]
            # With the guess itself, for an id is its own only while it is kept.
            prior = _prior(self._look.scene.model, x, self._belief)
            self._seen[id(x)] = (x, self._look.equations(x), prior)
        return self._seen[id(x)][1:]

    def scale(self, found: Equations) -> float:
        """Of the pixels' equations; those that come and go must not count as better or worse."""
        return self._say / max(found.weight, 1e-9)

    def cost(self, x: Guess) -> float:
        found, prior = self.at(x)
        return self.scale(found) * found.squares / 2 + prior.value

    def linearize(self, x: Guess) -> Callable[[float], tuple[Array, float]]:
        found, prior = self.at(x)
        factor, free = self.scale(found), self._free
        matrix = (factor * found.matrix + prior.hessian)[np.ix_(free, free)]
        downhill = (factor * found.vector - prior.gradient)[free]
        diagonal = np.diag(matrix)

        def step(damping: float) -> tuple[Array, float]:
            found = np.linalg.solve(matrix + np.diag(damping * diagonal), downhill)
            whole = np.zeros(len(free))
            whole[free] = found
            return whole, float(found @ (damping * diagonal * found + downhill)) / 2

        return step


class _Prior(NamedTuple):
    """Belief and D(p) at a guess.

    Attributes:
        value: >= 0.
        gradient: (N,).
        hessian: (N, N).
    """

    value: float
    gradient: Float[Array, " n"]
    hessian: Float[Array, "n n"]


def _prior(model: TrackedFace, guess: Guess, belief: Belief) -> _Prior:
    away, precision = guess.since(belief.mean), belief.deviations**-2.0
    value, gradient, hessian = float(precision @ away**2) / 2, precision * away, np.diag(precision)
    limits = model.limits
    shares = limits.directions @ guess.face.vector + limits.offset
    penalty = range_penalty(shares, LIMIT, limits.directions)
    if penalty is not None:
        value += penalty.value
        gradient[POSE_UNKNOWNS:] += penalty.gradient
        hessian[POSE_UNKNOWNS:, POSE_UNKNOWNS:] += penalty.hessian
    return _Prior(value, gradient, hessian)
