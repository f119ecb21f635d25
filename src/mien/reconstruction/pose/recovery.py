"""Cameras and feature points from their images in several photos.

Source:
    [Pighin 2002]'s pose recovery.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.camera import Camera
from mien.errors import EstimationError
from mien.numeric.similarity import Similarity, estimate_similarity
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.pose.alternation import Alternation, alternate
from mien.reconstruction.pose.initialization import (
    estimate_poses,
    poses_from_rotations,
    resect_robustly,
)
from mien.reconstruction.pose.linear_steps import Poses
from mien.reconstruction.pose.problem import (
    PoseProblem,
    check_problem,
    joint_sigma,
    moved_too_far,
    residual_lengths,
    rms_per_photo,
    weighted_lengths,
)

__all__ = ["PoseResult", "recover_pose"]

_MIN_POINTS = 6
_ROUNDS, _SWEEPS_A_ROUND = 6, 30
"""Robust rounds, each with the residual scale that the last one left."""
_REJECT_SIGMAS = (7.0, 5.0)
"""First in the robust solution, then in the least squares on what is left."""
_MIN_INLIERS = 0.6
"""Share of a photo's points that must agree with the other photos for it to count."""
_MAX_RATIO, _MIN_MISFIT_MM = 4.0, 1.0
"""A photo whose points fit so much worse than the others', and so badly, shows something else."""


@dataclass(frozen=True)
class PoseResult:
    """Recovered cameras and points.

    Attributes:
        cameras: one a photo; None where the photo was left out.
        points: (N, 3) mm, in the frame and scale of the initial shape; a point that fewer than two
            photos tell stays as it was.
        inliers: (K, N) observations that were seen and fit.
        rms_px: (K,) root mean square length of the inliers' reprojection errors; NaN if left out.
        problems: one a photo: why it was left out, "" if it fits.
        cost: sum of squared reprojection errors of the inliers, px^2.
        sweeps: rounds of five steps, all stages together.
        converged: whether the last stage settled.
    """

    cameras: tuple[Camera | None, ...]
    points: Float[Array, "n 3"]
    inliers: Bool[Array, "k n"]
    rms_px: Float[Array, " k"]
    problems: tuple[str, ...]
    cost: float
    sweeps: int
    converged: bool


def recover_pose(
    image_points: Float[Array, "k n 2"],
    points: Float[Array, "n 3"],
    sizes: Float[Array, "k 2"],
    *,
    principal_px: Float[Array, "k 2"] | None = None,
    rotations: Float[Array, "k 3 3"] | None = None,
    focal_px: Float[Array, " k"] | None = None,
    weights: Float[Array, "k n"] | None = None,
    loss: str = "cauchy",
    history: int = 10,
    max_misfit_mm: float = 12.0,
    max_sweeps: int = 300,
    tolerance: float = 1e-8,
) -> PoseResult:
    """Cameras and points by [Pighin 2002]'s five alternating linear least squares.

    Each photo is first placed by itself on the initial shape (camera steps only), then all unknowns
    are swept in [Pighin 2002]'s order, s, m, R, t_xy, eta. With a robust loss, observations that
    stay far off are dropped and the rest is solved again by plain least squares. A photo that does
    not fit the shape by itself, or that disagrees with the others, is left out and named in
    `problems`.

    Args:
        image_points: (K, N, 2) px, NaN where a photo does not show a point.
        points: (N, 3) mm, a rough shape, such as the generic head's.
        sizes: (K, 2) image width and height in px.
        principal_px: (K, 2); the image centres unless given.
        rotations: (K, 3, 3) rough R_cam_head, [Pighin 2002]'s way of starting; estimated unless
            given.
        focal_px: (K,) rough focal lengths, used only with rotations.
        weights: (K, N) >= 0, inverse variances of the observations up to a common factor.
        loss: "cauchy" or "huber" guard against bad points; "linear" is [Pighin 2002]'s least
            squares.
        history: sweeps that the acceleration remembers; 0 is [Pighin 2002]'s plain iteration.
        max_misfit_mm: a photo whose points lie farther (robust deviation) off the initial shape's
            best view shows something else.
        max_sweeps: of each stage, at most.
        tolerance: relative decrease of the cost at which a stage has settled.

    Raises:
        InputError: shapes, NaN, negative weights.
        EstimationError: no photo fits.

    Source:
        [Pighin 2002] sec. 5.1.1, eq. (2), app. A. Differs in the start from single photos, the
        robust weights, the acceleration and the rejection of outliers, not in the steps.
    """
    problem = check_problem(image_points, points, sizes, principal_px, weights)
    settings = _Settings(loss, history, max_sweeps, tolerance)
    start, problems = _start(problem, rotations, focal_px, max_misfit_mm, loss)
    while True:
        keep = np.array([not text for text in problems])
        if not keep.any():
            raise EstimationError("no photo fits: " + "; ".join(sorted(set(problems))))
        kept = problem.of(keep)
        solution, inliers = _solve(kept, start.of(keep), settings)
        outlier = _disagreeing_photo(kept, solution, inliers)
        if outlier is None:
            return _result(problem, keep, tuple(problems), solution, inliers)
        row, problem_text = outlier
        problems[np.flatnonzero(keep)[row]] = problem_text


@dataclass(frozen=True)
class _Settings:
    loss: str
    history: int
    max_sweeps: int
    tolerance: float


def _start(
    problem: PoseProblem,
    rotations: Array | None,
    focal_px: Array | None,
    max_misfit_mm: float,
    loss: str,
) -> tuple[Poses, list[str]]:
    """Each photo's pose on the initial shape, and what is wrong with those that do not fit it."""
    count = len(problem.image)
    if rotations is not None:
        rotations = check_array("rotations", rotations, (count, 3, 3))
    if focal_px is not None:
        focal_px = check_array("focal_px", focal_px, (count,))
    seen = np.count_nonzero(problem.weights, axis=1)
    enough = seen >= _MIN_POINTS
    problems = [
        "" if ok else f"shows {n} points, needs {_MIN_POINTS}"
        for ok, n in zip(enough, seen, strict=True)
    ]
    if not enough.any():
        return Poses.identity(count), problems
    given = problem.of(enough)
    if rotations is None:
        poses = estimate_poses(given.image, given.weights, given.points)
    else:
        focal = None if focal_px is None else focal_px[enough]
        poses = poses_from_rotations(
            rotations[enough], focal, given.image, given.weights, given.points
        )
    poses, misfits = resect_robustly(poses, given.points, given.image, given.weights, loss)
    for k, misfit in zip(np.flatnonzero(enough), misfits, strict=True):
        if misfit > max_misfit_mm:
            problems[k] = (
                f"its points lie {misfit:.0f} mm off any view of the initial shape, "
                f"at most {max_misfit_mm:.0f} mm would do"
            )
    # Photos with too few points keep a place in the arrays, never used.
    places = np.where(enough, np.cumsum(enough) - 1, len(poses.s))
    return Poses.stacked([poses, Poses.identity(1)]).of(places), problems


def _solve(
    problem: PoseProblem, start: Poses, settings: _Settings
) -> tuple[Alternation, Bool[Array, "k n"]]:
    """Robust sweeps with a shrinking scale, then least squares on what fits."""
    seen = problem.weights > 0
    state = Alternation(start, problem.points, np.inf, 0, True)
    if len(problem.image) == 1:
        return state, seen
    if settings.loss == "linear":
        return _alternate(problem, state, seen, settings, "linear", 1.0), seen
    sweeps = 0
    for round_ in range(_ROUNDS):
        sigma = joint_sigma(problem, state, seen)
        limit = _SWEEPS_A_ROUND if round_ < _ROUNDS - 1 else None
        state = _alternate(problem, state, seen, settings, settings.loss, sigma, limit)
        sweeps += state.sweeps
    inliers, far = seen, np.zeros(seen.shape[1], bool)
    for round_, limit_sigmas in enumerate(_REJECT_SIGMAS):
        sigma = joint_sigma(problem, state, inliers, robust=round_ == 0)
        far |= moved_too_far(problem, state, inliers)
        fits = seen & ~far & (weighted_lengths(problem, state) <= limit_sigmas * sigma)
        if round_ > 0 and (fits == inliers).all():
            break
        inliers = fits
        state = _alternate(problem, state, inliers, settings, "linear", 1.0)
        sweeps += state.sweeps
    return replace(state, sweeps=sweeps), inliers


def _alternate(
    problem: PoseProblem,
    state: Alternation,
    used: Bool[Array, "k n"],
    settings: _Settings,
    loss: str,
    sigma_px: float,
    max_sweeps: int | None = None,
) -> Alternation:
    return alternate(
        state.poses,
        state.points,
        problem.image,
        problem.weights * used,
        loss=loss_named(loss),
        sigma_px=sigma_px,
        history=settings.history,
        max_sweeps=max_sweeps or settings.max_sweeps,
        tolerance=settings.tolerance,
    )


def _disagreeing_photo(
    problem: PoseProblem, solution: Alternation, inliers: Bool[Array, "k n"]
) -> tuple[int, str] | None:
    """The photo that agrees least with the others, if it disagrees, and how it does."""
    if len(problem.image) < 3:
        return None
    shares = inliers.sum(axis=1) / np.count_nonzero(problem.weights, axis=1)
    worst = int(shares.argmin())
    if shares[worst] < _MIN_INLIERS:
        return worst, f"only {100 * shares[worst]:.0f} % of its points agree with the other photos"
    # A photo of coarse marks may fit as much worse as its weights say.
    rms_mm = rms_per_photo(problem, solution, inliers, weighted=True) / solution.poses.s
    worst = int(rms_mm.argmax())
    ratio = rms_mm[worst] / max(float(np.median(np.delete(rms_mm, worst))), 1e-9)
    if ratio > _MAX_RATIO and rms_mm[worst] > _MIN_MISFIT_MM:
        return worst, f"its points fit {ratio:.1f} times worse than the other photos'"
    return None


def _result(
    problem: PoseProblem,
    keep: Bool[Array, " k"],
    problems: tuple[str, ...],
    solution: Alternation,
    inliers: Bool[Array, "k n"],
) -> PoseResult:
    """The solution moved back onto the initial shape's frame and scale."""
    kept, poses = problem.of(keep), solution.poses
    determined = inliers.sum(axis=0) >= 2
    move = Similarity(1.0, np.eye(3), np.zeros(3))
    if np.count_nonzero(determined) >= 3:
        move = estimate_similarity(solution.points[determined], problem.points[determined])
    cameras: list[Camera | None] = [None] * len(keep)
    for row, k in enumerate(np.flatnonzero(keep)):
        rotation = poses.R[row] @ move.rotation.T
        shift = move.scale * np.append(poses.t[row], 1 / poses.eta[row])
        cameras[k] = Camera(
            width=int(kept.sizes[row, 0]),
            height=int(kept.sizes[row, 1]),
            focal_px=float(poses.s[row] / poses.eta[row]),
            R_cam_head=rotation,
            t_cam_head=shift - rotation @ (move.translation + problem.center),
            principal_px=kept.principal[row],
        )
    rms, all_inliers = np.full(len(keep), np.nan), np.zeros(problem.weights.shape, bool)
    rms[keep], all_inliers[keep] = rms_per_photo(kept, solution, inliers), inliers
    lengths = residual_lengths(kept, solution)
    return PoseResult(
        cameras=tuple(cameras),
        points=np.where(determined[:, None], move(solution.points), problem.points)
        + problem.center,
        inliers=all_inliers,
        rms_px=rms,
        problems=problems,
        cost=float((lengths[inliers] ** 2).sum()),
        sweeps=solution.sweeps,
        converged=solution.converged,
    )
