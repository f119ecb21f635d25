"""Head and face from a detector's landmarks alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.faces.landmarks import inside_picture
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES, DetectedFace
from mien.numeric.rotation import rotation_from_vector
from mien.numeric.solvers.levenberg_marquardt import minimize_lm
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.projection import CAMERA_SIZE, PinholeArrays, project_points
from mien.track.landmarks.detector_bias import facing_share, viewpoint, viewpoint_slopes
from mien.track.landmarks.model import Marks
from mien.track.state import Layout

ALIKE = 8.0
"""Landmarks err together: so many of them say as much as one."""
WEIGHT_SD, UNIT_SD = 1.5, 0.5
"""Of the weight of an expression, and of a unit, around 0."""
APART_SD = 0.3
"""Of what an expression's weight in a region differs from its mean over the regions."""
SCORE_SD = 0.2
"""How far a score of the detector lies off what the face's weights make expected."""
MOST = 1.2
"""A weight goes no farther than this, and not below 0."""
_SUM_SD = 0.05
"""How far a region's weights exceed 1 together."""
_SPARING = 1.0
"""Price of a whole weight, so that few expressions are mixed where many would do."""
_POSE = CAMERA_SIZE - 1
_ROUNDS = 12
_TOLERANCE = 1e-4
_FACE = slice(_POSE, None)
_SCORED = np.array([not name.startswith(("_neutral", "eyeLook")) for name in BLENDSHAPE_NAMES])
"""Where the eyes look is told by the irises."""


@dataclass(frozen=True)
class Guess:
    """Where a head is and what its face does.

    Attributes:
        R: (3, 3) R_cam_head.
        t: (3,) mm, t_cam_head.
        face: (P,) the unknowns of Marks.
    """

    R: Float[Array, "3 3"]
    t: Float[Array, " 3"]
    face: Float[Array, " p"]

    def moved(self, step: Float[Array, " q"]) -> Guess:
        """After a step in pose (as reconstruction.dense.projection has its unknowns) and face."""
        x, y, z = self.t
        t = np.array([x + step[3], y + step[4], z * np.exp(np.clip(step[5], -0.5, 0.5))])
        return Guess(rotation_from_vector(step[:3]) @ self.R, t, self.face + step[_FACE])


@dataclass(frozen=True)
class Observation:
    """The N landmarks of one picture that can be trusted, and the detector's scores.

    Attributes:
        places: (N, 3) mm on the neutral face.
        drift: (N, 3, 3) mm, last axis the viewpoint's.
        moves: (N, 3, P) mm, of the face's unknowns.
        image_points: (N, 2) px less the principal point.
        sigma_mm: (N,) each axis.
        scores: (S,) more than in the neutral face.
        score_moves: (P, S).
        R_cam_head: (3, 3) as the detector has it.
        kept: (N,) which of the 478 landmarks.
    """

    places: Float[Array, "n 3"]
    drift: Float[Array, "n 3 3"]
    moves: Float[Array, "n 3 p"]
    image_points: Float[Array, "n 2"]
    sigma_mm: Float[Array, " n"]
    scores: Float[Array, " s"]
    score_moves: Float[Array, "p s"]
    R_cam_head: Float[Array, "3 3"]
    kept: Int[Array, " n"]

    @staticmethod
    def of(marks: Marks, face: DetectedFace, size: tuple[int, int]) -> Observation:
        """Of a face that was found in a picture of this width and height."""
        trust = facing_share(-(marks.normals @ face.R_cam_head.T)[:, 2])
        trust = trust * inside_picture(face.points[:, :2], size)
        kept = np.flatnonzero(np.isfinite(marks.sigma_mm) & (trust > 0))
        return Observation(
            places=marks.places[kept],
            drift=np.ascontiguousarray(marks.drift[:, kept].transpose(1, 2, 0)),
            moves=np.ascontiguousarray(marks.moves[:, kept].transpose(1, 2, 0)),
            image_points=face.points[kept, :2] - np.array(size) / 2,
            sigma_mm=marks.sigma_mm[kept] / trust[kept],
            scores=(face.blendshapes - marks.scores)[_SCORED],
            score_moves=marks.score_moves[:, _SCORED],
            R_cam_head=face.R_cam_head,
            kept=kept,
        )

    def on(self, guess: Guess) -> Float[Array, "n 3"]:
        """(N, 3) mm, head space: where the landmarks are on such a head seen from there."""
        drifted = self.drift @ viewpoint(guess.R, guess.t)
        return self.places + drifted + self.moves @ guess.face

    def against(
        self, shown: DetectedFace, guess: Guess, size: tuple[int, int], focal_px: float
    ) -> Observation:
        """The same, less what the detector errs by in a picture of just this guess."""
        in_camera = self.on(guess) @ guess.R.T + guess.t
        wanted = focal_px * in_camera[:, :2] / in_camera[:, 2:] + np.array(size) / 2
        errors = shown.points[self.kept, :2] - wanted
        return replace(self, image_points=self.image_points - errors)

    def misfit_mm(self, guess: Guess, focal_px: float) -> float:
        """How far off the landmarks are from where they lie on a head, RMS."""
        x, y, z = (self.on(guess) @ guess.R.T + guess.t).T
        off = np.stack([x, y]) * focal_px / z - self.image_points.T
        return float(np.sqrt(((off * guess.t[2] / focal_px) ** 2).sum(axis=0).mean()))

    def start(self, focal_px: float) -> Guess:
        """The neutral head turned as the detector says, where its landmarks agree best."""
        x, y, z = self.R_cam_head @ self.places.T
        u, v = self.image_points.T
        none, focal = np.zeros_like(x), np.full_like(x, focal_px)
        rows = np.stack([[focal, none, -u], [none, focal, -v]]) / self.sigma_mm
        right = np.stack([u * z - focal_px * x, v * z - focal_px * y]) / self.sigma_mm
        normal = np.einsum("ajn,akn->jk", rows, rows)
        t = np.linalg.solve(normal, np.einsum("ajn,an->j", rows, right))
        return Guess(self.R_cam_head, t, np.zeros(len(self.score_moves)))


@dataclass(frozen=True)
class Measured:
    """How N landmarks lie off, with derivatives.

    Attributes:
        by_camera: (N, 2, 7) by the CAMERA_SIZE of a camera.
        by_place: (N, 2, 3) px / mm.
        residuals: (N, 2) px.
        weights: (N,) 1 / px^2.
    """

    by_camera: Float[Array, "n 2 7"]
    by_place: Float[Array, "n 2 3"]
    residuals: Float[Array, "n 2"]
    weights: Float[Array, " n"]

    def normal_equations(self, moves: Float[Array, "n 3 m"]) -> tuple[Array, Array]:
        """(7 + M, 7 + M) and (7 + M,): over the camera, and what moves the places, mm."""
        jacobian = np.concatenate([self.by_camera, self.by_place @ moves], axis=2)
        flat = jacobian.reshape(-1, jacobian.shape[2])
        weighted = flat * np.repeat(self.weights, 2)[:, None]
        return weighted.T @ flat, weighted.T @ self.residuals.ravel()


class MarkProblem:
    """How well head and face agree with the landmarks of a picture, and with what is usual.

    Half the sum of Cauchy's losses of the landmarks' distances over their errors, and of squares:
    of scores, of weights, and of what a region's weights exceed 1 by; and a price of weight.

    Args:
        near: tells from how far the landmarks are seen, which sets what their errors are in px.
    """

    def __init__(self, seen: Observation, layout: Layout, focal_px: float, *, near: Guess) -> None:
        self._seen, self._focal = seen, focal_px
        self._sigma_px = seen.sigma_mm * focal_px / near.t[2]
        count, expressions = len(near.face), len(layout.expressions) - 1
        mixed = len(layout.regions) * expressions
        self._regions = np.zeros((len(layout.regions), count))
        self._regions[:, :mixed] = np.repeat(np.eye(len(layout.regions)), expressions, axis=1)
        self._price = np.full(count, _SPARING)
        self._likely = _likely(layout, count)
        self._nowhere = np.zeros(len(seen.places), int)

    def cost(self, guess: Guess) -> float:
        """At a guess."""
        in_camera = self._seen.on(guess) @ guess.R.T + guess.t
        if in_camera[:, 2].min() <= 0:
            return np.inf
        points = self._focal * in_camera[:, :2] / in_camera[:, 2:]
        squares = ((points - self._seen.image_points) ** 2).sum(axis=1) / self._sigma_px**2
        loss, _ = loss_named("cauchy")(squares)
        return 0.5 * float(loss.sum()) / ALIKE + self._belief(guess.face)

    def _belief(self, face: Float[Array, " p"]) -> float:
        off = (self._seen.scores - face @ self._seen.score_moves) / SCORE_SD
        beyond = np.maximum(self._regions @ face - 1, 0) / _SUM_SD
        squares = off @ off + face @ self._likely @ face + beyond @ beyond
        return 0.5 * float(squares) + float(self._price @ face)

    def measured(self, guess: Guess) -> Measured:
        """The landmarks at a guess. Raises: EstimationError: one lies behind the camera."""
        seen = self._seen
        camera = PinholeArrays(guess.R[None], guess.t[None], np.array([self._focal]))
        projection = project_points(camera, self._nowhere, seen.on(guess))
        residuals = projection.image_points - seen.image_points
        _, share = loss_named("cauchy")((residuals**2).sum(axis=1) / self._sigma_px**2)
        weights = share / (ALIKE * self._sigma_px**2)
        by_camera = projection.camera_jacobian()
        slopes = viewpoint_slopes(guess.R, guess.t)
        by_camera[..., :_POSE] += projection.point_jacobian @ (seen.drift @ slopes)
        return Measured(by_camera, projection.point_jacobian, residuals, weights)

    def normal_equations(self, guess: Guess) -> tuple[Array, Array]:
        """(7 + P, 7 + P) and (7 + P,): Hessian and gradient over pose, log focal and face.

        Raises:
            EstimationError: a landmark lies behind the camera.
        """
        hessian, gradient = self.measured(guess).normal_equations(self._seen.moves)
        self.add_belief(guess.face, hessian[CAMERA_SIZE:, CAMERA_SIZE:], gradient[CAMERA_SIZE:])
        return hessian, gradient

    def add_belief(self, face: Array, hessian: Array, gradient: Array) -> None:
        """What is usual, (P, P) and (P,), on top of what is there."""
        moves = self._seen.score_moves
        off = face @ moves - self._seen.scores
        beyond = self._regions @ face - 1
        full = self._regions[beyond > 0]
        hessian += moves @ moves.T / SCORE_SD**2 + self._likely
        hessian += full.T @ full / _SUM_SD**2
        gradient += moves @ off / SCORE_SD**2 + self._likely @ face + self._price
        gradient += beyond[beyond > 0] @ full / _SUM_SD**2


def _likely(layout: Layout, count: int) -> Float[Array, "p p"]:
    """Precision of the face's unknowns before anything is seen."""
    regions, expressions = len(layout.regions), len(layout.expressions) - 1
    mixed = slice(regions * expressions)
    precision = np.eye(count) / UNIT_SD**2
    apart = (np.eye(regions) - 1 / regions) / APART_SD**2
    own = np.eye(regions) / WEIGHT_SD**2
    precision[mixed, mixed] = np.kron(apart + own, np.eye(expressions))
    return precision


def fit_face(seen: Observation, layout: Layout, focal_px: float, *, start: Guess) -> Guess:
    """Head and face of highest posterior; weights from 0 to 1.2.

    Raises:
        EstimationError: a landmark comes to lie behind the camera.
    """
    problem = MarkProblem(seen, layout, focal_px, near=start)
    known = np.arange(CAMERA_SIZE + len(start.face)) != _POSE  # The focal length.

    def linearize(guess: Guess) -> Callable[[float], tuple[Array, float]]:
        hessian, gradient = problem.normal_equations(guess)
        hessian, gradient = hessian[known][:, known], gradient[known]
        low, high = np.full(len(gradient), -np.inf), np.full(len(gradient), np.inf)
        low[_FACE], high[_FACE] = -guess.face, MOST - guess.face

        def solve(damping: float) -> tuple[Array, float]:
            damped = hessian + damping * np.diag(np.diagonal(hessian))
            step = bounded_step(damped, gradient, low, high)
            return step, -float(step @ gradient + 0.5 * step @ hessian @ step)

        return solve

    return minimize_lm(
        start,
        cost=problem.cost,
        linearize=linearize,
        move=Guess.moved,
        max_iterations=_ROUNDS,
        tolerance=_TOLERANCE,
    ).x


def bounded_step(
    hessian: Float[Array, "q q"],
    gradient: Float[Array, " q"],
    low: Float[Array, " q"],
    high: Float[Array, " q"],
) -> Float[Array, " q"]:
    """The step to the lowest place of a quadratic between bounds, nearly: what meets its bound

    on the way stays there. Bounds include 0.
    """
    step = np.zeros_like(gradient)
    # Against a bound that it starts at, nothing moves.
    held = ((low >= 0) & (gradient > 0)) | ((high <= 0) & (gradient < 0))
    while not held.all():
        free = ~held
        right = -gradient[free] - hessian[np.ix_(free, held)] @ step[held]
        wanted = np.linalg.solve(hessian[np.ix_(free, free)], right)
        step[free] = np.clip(wanted, low[free], high[free])
        beyond = step[free] != wanted
        if not beyond.any():
            break
        held[np.flatnonzero(free)[beyond]] = True
    return step
