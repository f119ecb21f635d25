"""Pose, then expression, by Levenberg-Marquardt on one size of a picture (P02 sec. 6.1.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.numeric.lm import minimize_lm
from mien.track.bands import band_pass, odd
from mien.track.drawing import Drawing, Pose, draw
from mien.track.equations import Comparison, Equations, band_equations, pose_equations
from mien.track.face import Anchor, FaceParameters, TrackedFace
from mien.track.flows import POSE_UNKNOWNS, screen_flows
from mien.track.penalty import range_penalty
from mien.track.views import View

BAND = 0.2
"""Width of the widest structures that expressions are told by, over the face's."""
SAY = 2000.0
"""How many independent observations a face's pixels are, however many: neighbours err alike."""
LIMIT = 200.0
"""c of P02's D(p), in units of the cost: a weight that is 0.1 out of range costs 2."""
_FARTHEST_GAZE = np.array([0.55, 0.4])
"""Radians to the sides, and up or down."""
_LEAST_NOISE = 0.5
"""Grey levels: nothing is believed to be drawn better than this."""


@dataclass(frozen=True)
class Guess:
    """P02's parameters p: where the head is and what the face does."""

    pose: Pose
    face: FaceParameters

    def moved(self, step: Float[Array, " n"]) -> Guess:
        """After a step in all unknowns: R <- R^ R (P02 app. B.2), everything else by addition."""
        import cv2

        turned = cv2.Rodrigues(np.asarray(step[:3]))[0] @ self.pose.R
        zoom = self.pose.zoom * float(np.exp(step[6]))
        pose = Pose(turned, self.pose.t + step[3:6], zoom)
        return Guess(pose, self.face.moved(step[POSE_UNKNOWNS:]))

    def since(self, other: Guess) -> Float[Array, " n"]:
        """The step that leads here from another."""
        import cv2

        # Never near a half turn, where this is less exact than numeric.rotation, and far quicker.
        turn = cv2.Rodrigues(self.pose.R @ other.pose.R.T)[0].ravel()
        zoom = np.log(self.pose.zoom / other.pose.zoom)
        face = self.face.vector - other.face.vector
        return np.concatenate([turn, self.pose.t - other.pose.t, [zoom], face])


@dataclass(frozen=True)
class Belief:
    """What is expected before the picture is looked at.

    Attributes:
        mean: the likeliest.
        deviations: (N,) standard deviations of a step away from it, each by itself.
    """

    mean: Guess
    deviations: Float[Array, " n"]


@dataclass(frozen=True)
class Scene:
    """One size of a frame, and all that a phase takes as given.

    Attributes:
        anchor: the face around which the model is linear.
        target: (h, w) float32 luma of the frame, as the colours of the head's photos would be.
        weights: (h, w) of the pixels.
        scale: grey levels by which a pixel may be off and still count.
        face_px: width of the face in this size.
    """

    model: TrackedFace
    anchor: Anchor
    view: View
    target: Float[Array, "h w"]
    weights: Float[Array, "h w"]
    scale: float
    face_px: float

    def draw(self, guess: Guess, *, layers: bool) -> Drawing:
        """The face as guessed; with `layers`, every expression's picture apart."""
        face = self.model.posed(self.anchor, guess.face)
        model = self.model
        return draw(
            model.painted,
            model.grey,
            model.compared,
            face,
            guess.pose,
            self.view,
            layers=layers,
        )


Linearize = Callable[[Scene, Guess], tuple[Equations, Drawing]]


def by_plain_pictures(scene: Scene, guess: Guess) -> tuple[Equations, Drawing]:
    """Equations of the pose alone, analytic; rows of the face's parameters are 0."""
    drawing = scene.draw(guess, layers=False)
    weights = scene.weights * drawing.mask
    comparison = Comparison(drawing.luma, scene.target, weights, scene.scale)
    found = pose_equations(drawing, comparison, guess.pose, scene.view)
    count = POSE_UNKNOWNS + len(guess.face.vector)
    matrix, vector = np.zeros((count, count)), np.zeros(count)
    matrix[:POSE_UNKNOWNS, :POSE_UNKNOWNS] = found.matrix
    vector[:POSE_UNKNOWNS] = found.vector
    return Equations(matrix, vector, found.squares, found.weight), drawing


def by_bands(scene: Scene, guess: Guess) -> tuple[Equations, Drawing]:
    """Equations of pose and face, analytic, over band-pass filtered pictures."""
    model = scene.model
    drawing = scene.draw(guess, layers=True)
    layers, drawn, target = band_pass(
        drawing.layers,
        drawing.luma,
        scene.target,
        drawing.mask,
        scene.weights,
        odd(BAND * scene.face_px),
    )
    comparison = Comparison(drawn, target, scene.weights * drawing.mask, scene.scale)
    flows = screen_flows(model.moves, drawing.places, guess.pose, scene.view)
    return band_equations(drawing, layers, comparison, flows, model.answers), drawing


@dataclass(frozen=True)
class Answer:
    """What a phase found.

    Attributes:
        guess: of least cost.
        deviations: (N,) standard deviations of the unknowns given picture and belief; the belief's
            own for those that were not free.
        information: (M, M) inverse covariance of the free unknowns.
        drawing: of the guess. iterations: linearizations made.
        rms: grey levels, of the pixels' weighted residual.
    """

    guess: Guess
    deviations: Float[Array, " n"]
    information: Float[Array, "m m"]
    drawing: Drawing
    iterations: int
    rms: float


def solve(
    scene: Scene,
    guess: Guess,
    belief: Belief,
    *,
    linearized: Linearize,
    free: Bool[Array, " n"],
    iterations: int,
    tolerance: float,
) -> Answer:
    """The free unknowns of least cost, by P02 eq. (6); damping is in proportion to the diagonal.

    The cost is the squared residual of the pixels, in units of the noise that the guess leaves and
    counted as SAY observations in all, plus half the squared distance from the belief, plus D(p).

    Args:
        linearized: gives the pixels' equations.
        iterations, tolerance: where to stop (numeric.lm).
    """
    # The last two only: the loop goes back to the one before when a step fails.
    seen: dict[int, tuple[Guess, Equations, Drawing, _Prior]] = {}

    def at(x: Guess) -> tuple[Guess, Equations, Drawing, _Prior]:
        if id(x) not in seen:
            while len(seen) > 1:
                del seen[next(iter(seen))]
            seen[id(x)] = (x, *linearized(scene, x), _prior(scene.model, x, belief))
        return seen[id(x)]

    first = at(guess)[1]
    say = min(1.0, SAY / scene.face_px**2)
    noise = max(first.squares / max(first.weight, 1e-9), _LEAST_NOISE**2)

    def scale(found: Equations) -> float:
        # Pixels that come and go at the outline must not count as better or worse.
        return say / noise * first.weight / max(found.weight, 1e-9)

    def cost(x: Guess) -> float:
        _, found, _, prior = at(x)
        return scale(found) * found.squares / 2 + prior.value

    def normal(x: Guess) -> tuple[Array, Array]:
        _, found, _, prior = at(x)
        factor = scale(found)
        matrix = (factor * found.matrix + prior.hessian)[np.ix_(free, free)]
        return matrix, (factor * found.vector - prior.gradient)[free]

    def linearize(x: Guess) -> Callable[[float], tuple[Array, float]]:
        matrix, downhill = normal(x)
        diagonal = np.diag(matrix)

        def step(damping: float) -> tuple[Array, float]:
            found = np.linalg.solve(matrix + np.diag(damping * diagonal), downhill)
            whole = np.zeros(len(free))
            whole[free] = found
            return whole, float(found @ (damping * diagonal * found + downhill)) / 2

        return step

    result = minimize_lm(
        guess,
        cost=cost,
        linearize=linearize,
        move=Guess.moved,
        max_iterations=iterations,
        tolerance=tolerance,
        max_failures=1,
    )
    _, found, drawing, _ = at(result.x)
    # Without D(p): that a weight is at the end of its range says nothing of how sure it is.
    information = scale(found) * found.matrix[np.ix_(free, free)]
    information += np.diag(belief.deviations[free] ** -2.0)
    deviations = belief.deviations.copy()
    deviations[free] = np.sqrt(np.diag(np.linalg.inv(information)))
    rms = float(np.sqrt(found.squares / max(found.weight, 1e-9)))
    return Answer(result.x, deviations, information, drawing, result.iterations, rms)


class _Prior(NamedTuple):
    """Belief and D(p) at a guess.

    Attributes:
        value: >= 0. gradient: (N,). hessian: (N, N).
    """

    value: float
    gradient: Float[Array, " n"]
    hessian: Float[Array, "n n"]


def _prior(model: TrackedFace, guess: Guess, belief: Belief) -> _Prior:
    away, precision = guess.since(belief.mean), belief.deviations**-2.0
    value, gradient, hessian = float(precision @ away**2) / 2, precision * away, np.diag(precision)
    Q = model.basis.Q
    rows = [(row, Q) for row in model.basis.weights(guess.face.alpha)]
    rows.append((guess.face.units, np.eye(len(guess.face.units))))
    # Eyes turn no farther, and lids hide what would tell.
    rows.append((0.5 + guess.face.gaze / 2 / _FARTHEST_GAZE, np.diag(0.5 / _FARTHEST_GAZE)))
    start = POSE_UNKNOWNS
    for weights, directions in rows:
        own = slice(start, start + directions.shape[1])
        start = own.stop
        limits = range_penalty(weights, LIMIT, directions)
        if limits is not None:
            value += limits.value
            gradient[own] += limits.gradient
            hessian[own, own] += limits.hessian
    return _Prior(value, gradient, hessian)
