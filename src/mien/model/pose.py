"""Cameras and feature points from their images in several photos (P02's pose recovery)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.camera import Camera
from mien.errors import EstimationError, InputError
from mien.model.alternation import Alternation, alternate
from mien.model.five_steps import Poses, reprojection
from mien.model.pose_start import estimate_poses, poses_from_rotations, resect
from mien.numeric.robust import loss_named, robust_sigma
from mien.numeric.similarity import estimate_similarity

__all__ = ["PoseResult", "recover_pose"]

_MIN_POINTS = 6
_SIGMA_FLOOR_PX = 1e-3
_REJECT_SIGMAS = 5.0
_MIN_TRUSTED = 0.6
"""Share of a photo's points that must fit for the photo to count."""
_MAX_RATIO = 4.0
"""A photo whose points fit this many times worse than the others' shows something else."""


@dataclass(frozen=True)
class PoseResult:
    """Recovered cameras and points.

    Attributes:
        cameras: one a photo; None where the photo was left out.
        points: (N, 3) mm, in the frame and scale of the initial shape; a point that no photo
            tells stays as it was.
        trusted: (K, N) observations that were seen and fit.
        rms_px: (K,) root mean square length of the trusted reprojection errors; NaN if left out.
        problems: one a photo: why it was left out, "" if it fits.
        cost: sum of squared reprojection errors of the trusted observations, px^2.
        sweeps: rounds of five steps, all stages together.
        converged: whether the last stage settled.
    """

    cameras: tuple[Camera | None, ...]
    points: Float[Array, "n 3"]
    trusted: Bool[Array, "k n"]
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
    """Cameras and points by P02's five alternating linear least squares.

    Each photo is first placed by itself on the initial shape (camera steps only), then all unknowns
    are swept in P02's order, s, m, R, t_xy, eta. With a robust loss, observations that stay far off
    are dropped and the rest is solved again by plain least squares. A photo that does not fit the
    shape by itself, or that spoils the joint solution, is left out and named in `problems`.

    Args:
        image_points: (K, N, 2) px, NaN where a photo does not show a point.
        points: (N, 3) mm, a rough shape, such as the generic head's.
        sizes: (K, 2) image width and height in px.
        principal_px: (K, 2); the image centres unless given.
        rotations: (K, 3, 3) rough R_cam_head, P02's way of starting; estimated unless given.
        focal_px: (K,) rough focal lengths, used only with rotations.
        weights: (K, N) >= 0, trust in an observation.
        loss: "cauchy" or "huber" guard against bad points; "linear" is P02's least squares.
        history: sweeps that the acceleration remembers; 0 is P02's plain iteration.
        max_misfit_mm: a photo whose points lie farther (robust deviation) off the initial shape's
            best view shows something else.
    Raises: InputError: shapes, NaN, negative weights. EstimationError: no photo fits.
    Source: P02 sec. 5.1.1, eq. (2), app. A. Differs in the start from single photos, the robust
        weights, the acceleration and the verdicts; the steps are P02's.
    """
    problem = _check(image_points, points, sizes, principal_px, weights)
    settings = _Settings(loss, history, max_sweeps, tolerance)
    problems = [
        "" if count >= _MIN_POINTS else f"shows {count} points, needs {_MIN_POINTS}"
        for count in np.count_nonzero(problem.weights, axis=1)
    ]
    start = _start(problem, problems, rotations, focal_px, max_misfit_mm, loss)
    while True:
        keep = np.array([not text for text in problems])
        if not keep.any():
            raise EstimationError("no photo fits: " + "; ".join(sorted(set(problems))))
        solution, trusted = _solve(problem.of(keep), _of(start, keep), settings)
        worst = _worst_photo(problem.of(keep), solution, trusted)
        if worst is None:
            return _result(problem, keep, tuple(problems), solution, trusted)
        problems[np.flatnonzero(keep)[worst[0]]] = worst[1]


@dataclass(frozen=True)
class _Settings:
    loss: str
    history: int
    max_sweeps: int
    tolerance: float


@dataclass(frozen=True)
class _Problem:
    """Centred observations: image (K, N, 2) relative to principal, points relative to center."""

    image: Float[Array, "k n 2"]
    weights: Float[Array, "k n"]
    points: Float[Array, "n 3"]
    center: Float[Array, " 3"]
    sizes: Float[Array, "k 2"]
    principal: Float[Array, "k 2"]

    def of(self, keep: Bool[Array, " k"]) -> _Problem:
        return replace(
            self,
            image=self.image[keep],
            weights=self.weights[keep],
            sizes=self.sizes[keep],
            principal=self.principal[keep],
        )


def _check(
    image_points: Array, points: Array, sizes: Array, principal: Array | None, weights: Array | None
) -> _Problem:
    points = check_array("points", points, (None, 3))
    image = check_array("image_points", image_points, (None, len(points), 2), finite=False)
    sizes = check_array("sizes", sizes, (len(image), 2))
    if (sizes <= 0).any():
        raise InputError("sizes", "widths and heights above zero", sizes.min())
    principal = sizes / 2 if principal is None else principal
    principal = check_array("principal_px", principal, (len(image), 2))
    seen = np.isfinite(image).all(axis=2)
    weights = np.ones(seen.shape) if weights is None else weights
    weights = check_array("weights", weights, seen.shape)
    if (weights < 0).any():
        raise InputError("weights", "numbers of 0 or more", weights.min())
    weights = np.where(seen, weights, 0.0)
    used = weights.any(axis=0)
    center = points[used].mean(axis=0) if used.any() else np.zeros(3)
    relative = np.where(seen[..., None], image - principal[:, None], 0.0)
    return _Problem(relative, weights, points - center, center, sizes, principal)


def _start(
    problem: _Problem,
    problems: list[str],
    rotations: Array | None,
    focal_px: Array | None,
    max_misfit_mm: float,
    loss: str,
) -> Poses:
    """Each photo on the initial shape; those that do not fit it get a problem."""
    count = len(problem.image)
    poses = Poses(
        np.ones(count),
        np.tile(np.eye(3), (count, 1, 1)),
        np.zeros((count, 2)),
        np.full(count, 1e-3),
    )
    if rotations is not None:
        rotations = check_array("rotations", rotations, (count, 3, 3))
    if focal_px is not None:
        focal_px = check_array("focal_px", focal_px, (count,))
    for k in range(count):
        if problems[k]:
            continue
        one = np.arange(count) == k
        part = problem.of(one)
        if rotations is None:
            pose = estimate_poses(part.image, part.weights, part.points)
        else:
            focal = None if focal_px is None else focal_px[one]
            pose = poses_from_rotations(
                rotations[one], focal, part.image, part.weights, part.points
            )
        pose, misfit = _resect_robustly(pose, part, loss)
        if misfit > max_misfit_mm:
            problems[k] = (
                f"its points lie {misfit:.0f} mm off any view of the initial shape "
                f"(at most {max_misfit_mm:.0f})"
            )
        for name in ("s", "R", "t", "eta"):
            getattr(poses, name)[k] = getattr(pose, name)[0]
    return poses


def _resect_robustly(pose: Poses, part: _Problem, loss: str) -> tuple[Poses, float]:
    """The pose over the initial shape, and the robust deviation from it in mm."""
    weights, sigma = part.weights, np.inf
    seen = part.weights > 0
    for _ in range(4):
        pose = resect(pose, part.points, part.image, weights)
        lengths = np.linalg.norm(reprojection(pose, part.points) - part.image, axis=-1)
        sigma = max(robust_sigma(lengths[seen]), _SIGMA_FLOOR_PX)
        weights = part.weights * loss_named(loss)((lengths / sigma) ** 2)[1]
    return pose, sigma * _spread(part.points, part.weights) / _spread(part.image[0], part.weights)


def _spread(positions: Array, weights: Array) -> float:
    """Size of what is seen, whatever the pose makes of it."""
    return float(np.sqrt(positions[weights[0] > 0].var(axis=0).sum()))


def _solve(
    problem: _Problem, start: Poses, settings: _Settings
) -> tuple[Alternation, Bool[Array, "k n"]]:
    """Robust sweeps with a shrinking scale, then least squares on what fits."""
    seen = problem.weights > 0
    if len(problem.image) == 1:
        only = Alternation(start, problem.points, 0.0, 0, True)
        return only, seen
    state = Alternation(start, problem.points, np.inf, 0, False)
    sweeps = 0
    if settings.loss != "linear":
        for _ in range(6):
            sigma = _joint_sigma(problem, state, seen)
            state = _alternate(problem, state, problem.weights, settings, settings.loss, sigma, 30)
            sweeps += state.sweeps
        sigma = _joint_sigma(problem, state, seen)
        state = _alternate(problem, state, problem.weights, settings, settings.loss, sigma)
        sweeps += state.sweeps
        sigma = _joint_sigma(problem, state, seen)
        seen = seen & (_lengths(problem, state) <= _REJECT_SIGMAS * sigma)
    state = _alternate(problem, state, problem.weights * seen, settings, "linear", 1.0)
    return replace(state, sweeps=sweeps + state.sweeps), seen


def _alternate(
    problem: _Problem,
    state: Alternation,
    weights: Array,
    settings: _Settings,
    loss: str,
    sigma: float,
    max_sweeps: int | None = None,
) -> Alternation:
    return alternate(
        state.poses,
        state.points,
        problem.image,
        weights,
        loss=loss_named(loss),
        sigma_px=sigma,
        history=settings.history,
        max_sweeps=max_sweeps or settings.max_sweeps,
        tolerance=settings.tolerance,
    )


def _lengths(problem: _Problem, state: Alternation) -> Float[Array, "k n"]:
    lengths: Array = np.linalg.norm(
        reprojection(state.poses, state.points) - problem.image, axis=-1
    )
    return lengths


def _joint_sigma(problem: _Problem, state: Alternation, seen: Bool[Array, "k n"]) -> float:
    """Residual deviation in px per axis, corrected for the unknowns that the data were fitted by."""
    shared = seen & (seen.sum(axis=0) >= 2)
    rows = 2 * np.count_nonzero(shared)
    unknowns = 7 * len(seen) - 7 + 3 * np.count_nonzero(shared.any(axis=0))
    if rows <= unknowns:
        return _SIGMA_FLOOR_PX
    spread = robust_sigma(_lengths(problem, state)[shared])
    return max(spread * float(np.sqrt(rows / (rows - unknowns))), _SIGMA_FLOOR_PX)


def _worst_photo(
    problem: _Problem, solution: Alternation, trusted: Bool[Array, "k n"]
) -> tuple[int, str] | None:
    """The photo that does not belong, if any, and why."""
    count = len(problem.image)
    if count < 3:
        return None
    shares = trusted.sum(axis=1) / np.count_nonzero(problem.weights, axis=1)
    rms_mm = _rms(problem, solution, trusted) / solution.poses.s
    ratios = np.array(
        [rms_mm[k] / max(np.median(np.delete(rms_mm, k)), 1e-9) for k in range(count)]
    )
    if shares.min() < _MIN_TRUSTED:
        worst = int(shares.argmin())
        return worst, f"only {100 * shares[worst]:.0f} % of its points agree with the other photos"
    worst = int(ratios.argmax())
    if ratios[worst] > _MAX_RATIO and rms_mm[worst] > 1.0:
        return worst, f"its points fit {ratios[worst]:.1f} times worse than the other photos'"
    return None


def _rms(problem: _Problem, solution: Alternation, trusted: Array) -> Float[Array, " k"]:
    squared = np.where(trusted, _lengths(problem, solution) ** 2, 0.0)
    return np.sqrt(squared.sum(axis=1) / np.maximum(trusted.sum(axis=1), 1))


def _result(
    problem: _Problem,
    keep: Bool[Array, " k"],
    problems: tuple[str, ...],
    solution: Alternation,
    trusted: Bool[Array, "k n"],
) -> PoseResult:
    """The solution moved back onto the initial shape's frame and scale."""
    kept = problem.of(keep)
    rms = np.full(len(keep), np.nan)
    rms[keep] = _rms(kept, solution, trusted)
    all_trusted = np.zeros(problem.weights.shape, bool)
    all_trusted[keep] = trusted
    points, move = solution.points, None
    told = trusted.sum(axis=0) >= 2
    if np.count_nonzero(told) >= 3:
        move = estimate_similarity(points[told], problem.points[told])
        points = np.where(told[:, None], move(points), problem.points)
    cameras: list[Camera | None] = [None] * len(keep)
    for row, k in enumerate(np.flatnonzero(keep)):
        poses = solution.poses
        eta = float(poses.eta[row])
        rotation, shift = poses.R[row], np.append(poses.t[row], 1 / eta)
        if move is not None:
            rotation = rotation @ move.rotation.T
            shift = move.scale * shift - rotation @ move.translation
        cameras[k] = Camera(
            width=int(kept.sizes[row, 0]),
            height=int(kept.sizes[row, 1]),
            focal_px=float(poses.s[row]) / eta,
            R_cam_head=rotation,
            t_cam_head=shift - rotation @ problem.center,
            principal_px=kept.principal[row],
        )
    return PoseResult(
        cameras=tuple(cameras),
        points=points + problem.center,
        trusted=all_trusted,
        rms_px=rms,
        problems=problems,
        cost=float((np.where(trusted, _lengths(kept, solution), 0.0) ** 2).sum()),
        sweeps=solution.sweeps,
        converged=solution.converged,
    )


def _of(poses: Poses, keep: Bool[Array, " k"]) -> Poses:
    return Poses(poses.s[keep], poses.R[keep], poses.t[keep], poses.eta[keep])
