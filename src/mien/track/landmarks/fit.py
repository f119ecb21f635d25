"""Pose and face of a known head from a detector's landmarks alone."""

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
from mien.track.landmarks.detector_bias import cosine_weights, viewpoint, viewpoint_jacobian
from mien.track.landmarks.model import LandmarkModel
from mien.track.state import Layout

CORRELATED_LANDMARKS = 8.0
"""Errors of landmarks are correlated: so many of them count as one independent observation."""
WEIGHT_SD, UNIT_SD = 1.5, 0.5
"""Prior standard deviations of the weight of an expression, and of a unit, around 0."""
REGION_DIFFERENCE_SD = 0.3
"""Of the difference of an expression's weight in a region from its mean over the regions."""
SCORE_SD = 0.2
"""Of a score of the detector around the one that the face's weights predict."""
MAX_WEIGHT = 1.2
"""Upper bound of a weight; the lower one is 0."""
_EXCESS_SD = 0.05
"""Of the excess over 1 of the sum of a region's weights."""
_WEIGHT_PENALTY = 1.0
"""Cost of a weight of 1 (an L1 penalty), so that few expressions are mixed where many would do."""
_POSE = CAMERA_SIZE - 1
_MAX_ITERATIONS = 12
_TOLERANCE = 1e-4
_FACE = slice(_POSE, None)
_SCORED = np.array([not name.startswith(("_neutral", "eyeLook")) for name in BLENDSHAPE_NAMES])
"""Scores that are compared; the gaze is measured at the irises instead."""


@dataclass(frozen=True)
class PoseAndFace:
    """A head's pose and the unknowns of its face.

    Attributes:
        R: (3, 3) R_cam_head.
        t: (3,) mm, t_cam_head.
        face: (P,) the unknowns of a LandmarkModel.
    """

    R: Float[Array, "3 3"]
    t: Float[Array, " 3"]
    face: Float[Array, " p"]

    def plus(self, step: Float[Array, " q"]) -> PoseAndFace:
        """After a step in pose (its unknowns as in reconstruction.bundle.projection) and face."""
        x, y, z = self.t
        t = np.array([x + step[3], y + step[4], z * np.exp(np.clip(step[5], -0.5, 0.5))])
        return PoseAndFace(rotation_from_vector(step[:3]) @ self.R, t, self.face + step[_FACE])


@dataclass(frozen=True)
class LandmarkObservation:
    """The N visible landmarks of one picture, and the detector's scores.

    Attributes:
        positions: (N, 3) mm, head space, on the neutral face.
        view_slopes: (N, 3, 3) mm, last axis the viewpoint's coordinates.
        offsets: (N, 3, P) mm by the face's unknowns.
        image_points: (N, 2) px less the principal point.
        sigma_mm: (N,) standard deviations, each axis.
        scores: (S,) less those of the neutral face.
        score_offsets: (P, S) by the face's unknowns.
        R_cam_head: (3, 3) by the detector.
        indices: (N,) of the landmarks among the 478.
    """

    positions: Float[Array, "n 3"]
    view_slopes: Float[Array, "n 3 3"]
    offsets: Float[Array, "n 3 p"]
    image_points: Float[Array, "n 2"]
    sigma_mm: Float[Array, " n"]
    scores: Float[Array, " s"]
    score_offsets: Float[Array, "p s"]
    R_cam_head: Float[Array, "3 3"]
    indices: Int[Array, " n"]

    @staticmethod
    def from_detection(
        model: LandmarkModel, face: DetectedFace, size: tuple[int, int]
    ) -> LandmarkObservation:
        """Of a face detected in a picture.

        Args:
            model: of the head.
            face: in px of the picture.
            size: the picture's width and height, px.
        """
        weights = cosine_weights(-(model.normals @ face.R_cam_head.T)[:, 2])
        weights = weights * inside_picture(face.points[:, :2], size)
        indices = np.flatnonzero(np.isfinite(model.sigma_mm) & (weights > 0))
        return LandmarkObservation(
            positions=model.positions[indices],
            view_slopes=np.ascontiguousarray(model.view_slopes[:, indices].transpose(1, 2, 0)),
            offsets=np.ascontiguousarray(model.offsets[:, indices].transpose(1, 2, 0)),
            image_points=face.points[indices, :2] - np.array(size) / 2,
            sigma_mm=model.sigma_mm[indices] / weights[indices],
            scores=(face.blendshapes - model.scores)[_SCORED],
            score_offsets=model.score_offsets[:, _SCORED],
            R_cam_head=face.R_cam_head,
            indices=indices,
        )

    def positions_at(self, estimate: PoseAndFace) -> Float[Array, "n 3"]:
        """(N, 3) mm, head space: the landmarks of such a face seen from there."""
        by_viewpoint = self.view_slopes @ viewpoint(estimate.R, estimate.t)
        return self.positions + by_viewpoint + self.offsets @ estimate.face

    def bias_corrected(
        self, rendered: DetectedFace, estimate: PoseAndFace, size: tuple[int, int], focal_px: float
    ) -> LandmarkObservation:
        """The same, less the detector's errors in a rendered picture of an estimate.

        Args:
            rendered: what it detects in that picture.
            estimate: that is rendered.
            size: the picture's width and height, px.
            focal_px: the picture's.
        """
        in_camera = self.positions_at(estimate) @ estimate.R.T + estimate.t
        expected = focal_px * in_camera[:, :2] / in_camera[:, 2:] + np.array(size) / 2
        errors = rendered.points[self.indices, :2] - expected
        return replace(self, image_points=self.image_points - errors)

    def rms_mm(self, estimate: PoseAndFace, focal_px: float) -> float:
        """RMS distance of the observed landmarks from those of an estimate, at its depth."""
        x, y, z = (self.positions_at(estimate) @ estimate.R.T + estimate.t).T
        residuals = np.stack([x, y]) * focal_px / z - self.image_points.T
        return float(np.sqrt(((residuals * estimate.t[2] / focal_px) ** 2).sum(axis=0).mean()))

    def initial_pose(self, focal_px: float) -> PoseAndFace:
        """The neutral head in the detector's rotation, translated by linear least squares."""
        x, y, z = self.R_cam_head @ self.positions.T
        u, v = self.image_points.T
        zero, focal = np.zeros_like(x), np.full_like(x, focal_px)
        rows = np.stack([[focal, zero, -u], [zero, focal, -v]]) / self.sigma_mm
        right = np.stack([u * z - focal_px * x, v * z - focal_px * y]) / self.sigma_mm
        normal = np.einsum("ajn,akn->jk", rows, rows)
        t = np.linalg.solve(normal, np.einsum("ajn,an->j", rows, right))
        return PoseAndFace(self.R_cam_head, t, np.zeros(len(self.score_offsets)))


@dataclass(frozen=True)
class LandmarkLinearization:
    """Residuals of N landmarks with their derivatives.

    Attributes:
        camera_jacobian: (N, 2, 7) px by the CAMERA_SIZE unknowns of a camera.
        point_jacobian: (N, 2, 3) px / mm.
        residuals: (N, 2) px.
        weights: (N,) 1 / px^2, robust.
    """

    camera_jacobian: Float[Array, "n 2 7"]
    point_jacobian: Float[Array, "n 2 3"]
    residuals: Float[Array, "n 2"]
    weights: Float[Array, " n"]

    def normal_equations(self, offsets: Float[Array, "n 3 m"]) -> tuple[Array, Array]:
        """(7 + M, 7 + M) and (7 + M,): over the camera and M unknowns that move the landmarks."""
        jacobian = np.concatenate([self.camera_jacobian, self.point_jacobian @ offsets], axis=2)
        flat = jacobian.reshape(-1, jacobian.shape[2])
        weighted = flat * np.repeat(self.weights, 2)[:, None]
        return weighted.T @ flat, weighted.T @ self.residuals.ravel()


class LandmarkProblem:
    """Maximum a posteriori estimation of pose and face from the landmarks of one picture.

    The cost is half the sum of Cauchy losses of the landmarks' distances over their standard
    deviations, and of squares: of scores, of weights, and of the excess over 1 of a region's
    weights; and an L1 penalty of the weights.

    Args:
        observation: the landmarks.
        layout: of the face's unknowns.
        focal_px: the picture's.
        initial: whose distance converts the landmarks' standard deviations into px.
    """

    def __init__(
        self,
        observation: LandmarkObservation,
        layout: Layout,
        focal_px: float,
        *,
        initial: PoseAndFace,
    ) -> None:
        self._observation, self._focal = observation, focal_px
        self._sigma_px = observation.sigma_mm * focal_px / initial.t[2]
        count, expressions = len(initial.face), len(layout.expressions) - 1
        mixed = len(layout.regions) * expressions
        self._regions = np.zeros((len(layout.regions), count))
        self._regions[:, :mixed] = np.repeat(np.eye(len(layout.regions)), expressions, axis=1)
        self._penalty = np.full(count, _WEIGHT_PENALTY)
        self._prior_precision = _prior_precision(layout, count)
        self._camera_indices = np.zeros(len(observation.positions), int)

    def cost(self, estimate: PoseAndFace) -> float:
        """At an estimate; infinite where a landmark lies behind the camera."""
        in_camera = self._observation.positions_at(estimate) @ estimate.R.T + estimate.t
        if in_camera[:, 2].min() <= 0:
            return np.inf
        points = self._focal * in_camera[:, :2] / in_camera[:, 2:]
        squares = ((points - self._observation.image_points) ** 2).sum(axis=1) / self._sigma_px**2
        loss, _ = loss_named("cauchy")(squares)
        return 0.5 * float(loss.sum()) / CORRELATED_LANDMARKS + self._prior_cost(estimate.face)

    def _prior_cost(self, face: Float[Array, " p"]) -> float:
        residuals = (self._observation.scores - face @ self._observation.score_offsets) / SCORE_SD
        excess = np.maximum(self._regions @ face - 1, 0) / _EXCESS_SD
        squares = residuals @ residuals + face @ self._prior_precision @ face + excess @ excess
        return 0.5 * float(squares) + float(self._penalty @ face)

    def linearize(self, estimate: PoseAndFace) -> LandmarkLinearization:
        """Residuals at an estimate.

        Raises:
            EstimationError: a landmark lies behind the camera.
        """
        observation = self._observation
        camera = PinholeArrays(estimate.R[None], estimate.t[None], np.array([self._focal]))
        projection = project_points(
            camera, self._camera_indices, observation.positions_at(estimate)
        )
        residuals = projection.image_points - observation.image_points
        _, robust = loss_named("cauchy")((residuals**2).sum(axis=1) / self._sigma_px**2)
        weights = robust / (CORRELATED_LANDMARKS * self._sigma_px**2)
        camera_jacobian = projection.camera_jacobian()
        by_pose = viewpoint_jacobian(estimate.R, estimate.t)
        camera_jacobian[..., :_POSE] += projection.point_jacobian @ (
            observation.view_slopes @ by_pose
        )
        return LandmarkLinearization(camera_jacobian, projection.point_jacobian, residuals, weights)

    def normal_equations(self, estimate: PoseAndFace) -> tuple[Array, Array]:
        """(7 + P, 7 + P) and (7 + P,): Hessian and gradient over pose, log focal and face.

        Raises:
            EstimationError: a landmark lies behind the camera.
        """
        hessian, gradient = self.linearize(estimate).normal_equations(self._observation.offsets)
        self.add_prior(estimate.face, hessian[CAMERA_SIZE:, CAMERA_SIZE:], gradient[CAMERA_SIZE:])
        return hessian, gradient

    def add_prior(self, face: Array, hessian: Array, gradient: Array) -> None:
        """Add the prior's and the scores' terms, (P, P) and (P,), in place."""
        by_face = self._observation.score_offsets
        residuals = face @ by_face - self._observation.scores
        excess = self._regions @ face - 1
        exceeding = self._regions[excess > 0]
        hessian += by_face @ by_face.T / SCORE_SD**2 + self._prior_precision
        hessian += exceeding.T @ exceeding / _EXCESS_SD**2
        gradient += by_face @ residuals / SCORE_SD**2 + self._prior_precision @ face + self._penalty
        gradient += excess[excess > 0] @ exceeding / _EXCESS_SD**2


def _prior_precision(layout: Layout, count: int) -> Float[Array, "p p"]:
    """(P, P) precision matrix of the Gaussian prior of the face's unknowns."""
    regions, expressions = len(layout.regions), len(layout.expressions) - 1
    mixed = slice(regions * expressions)
    precision = np.eye(count) / UNIT_SD**2
    differences = (np.eye(regions) - 1 / regions) / REGION_DIFFERENCE_SD**2
    own = np.eye(regions) / WEIGHT_SD**2
    precision[mixed, mixed] = np.kron(differences + own, np.eye(expressions))
    return precision


def fit_face(
    observation: LandmarkObservation, layout: Layout, focal_px: float, *, initial: PoseAndFace
) -> PoseAndFace:
    """Pose and face of highest posterior by Levenberg-Marquardt; weights from 0 to 1.2.

    Args:
        observation: the landmarks.
        layout: of the face's unknowns.
        focal_px: the picture's.
        initial: where the iteration starts.

    Raises:
        EstimationError: a landmark comes to lie behind the camera.
    """
    problem = LandmarkProblem(observation, layout, focal_px, initial=initial)
    solved = np.arange(CAMERA_SIZE + len(initial.face)) != _POSE  # All but the focal length.

    def linearize(estimate: PoseAndFace) -> Callable[[float], tuple[Array, float]]:
        hessian, gradient = problem.normal_equations(estimate)
        hessian, gradient = hessian[solved][:, solved], gradient[solved]
        low, high = np.full(len(gradient), -np.inf), np.full(len(gradient), np.inf)
        low[_FACE], high[_FACE] = -estimate.face, MAX_WEIGHT - estimate.face

        def solve(damping: float) -> tuple[Array, float]:
            damped = hessian + damping * np.diag(np.diagonal(hessian))
            step = bounded_step(damped, gradient, low, high)
            return step, -float(step @ gradient + 0.5 * step @ hessian @ step)

        return solve

    return minimize_lm(
        initial,
        cost=problem.cost,
        linearize=linearize,
        move=PoseAndFace.plus,
        max_iterations=_MAX_ITERATIONS,
        tolerance=_TOLERANCE,
    ).x


def bounded_step(
    hessian: Float[Array, "q q"],
    gradient: Float[Array, " q"],
    low: Float[Array, " q"],
    high: Float[Array, " q"],
) -> Float[Array, " q"]:
    """Approximate minimizer of a quadratic within bounds that include 0, by an active-set method.

    A component that reaches its bound stays there.

    Args:
        hessian: (Q, Q), positive definite.
        gradient: (Q,) at 0.
        low: (Q,) not above 0.
        high: (Q,) not below 0.
    """
    step = np.zeros_like(gradient)
    # Components at a bound that the gradient pushes against are fixed from the start.
    fixed = ((low >= 0) & (gradient > 0)) | ((high <= 0) & (gradient < 0))
    while not fixed.all():
        free = ~fixed
        right = -gradient[free] - hessian[np.ix_(free, fixed)] @ step[fixed]
        unbounded = np.linalg.solve(hessian[np.ix_(free, free)], right)
        step[free] = np.clip(unbounded, low[free], high[free])
        clipped = step[free] != unbounded
        if not clipped.any():
            break
        fixed[np.flatnonzero(free)[clipped]] = True
    return step
