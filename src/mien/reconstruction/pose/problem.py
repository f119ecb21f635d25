"""What pose recovery is given, checked and centred, and how far a solution is from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.errors import InputError
from mien.numeric.similarity import estimate_similarity
from mien.numeric.solvers.robust import robust_sigma
from mien.reconstruction.pose.alternation import Alternation
from mien.reconstruction.pose.linear_steps import reprojection

__all__ = [
    "PoseProblem",
    "check_problem",
    "joint_sigma",
    "moved_too_far",
    "residual_lengths",
    "rms_per_photo",
    "weighted_lengths",
]

SIGMA_FLOOR_PX = 1e-3
"""Residual scales below this are exact data; a smaller scale would only amplify rounding."""

_MIN_ALIGNED, _MOVED_SIGMAS, _LEAST_LIMIT_MM = 8, 12.0, 15.0
"""Wide: ears differ from person to person by several times what noses do."""


@dataclass(frozen=True)
class PoseProblem:
    """Observations about the optical axes and points about their centre.

    Attributes:
        image: (K, N, 2) px relative to the principal points, 0 where unseen.
        weights: (K, N), inverse variances with a median of 1, 0 where unseen.
        points: (N, 3) mm relative to center.
        center: (3,) mm.
        sizes: (K, 2) px.
        principal: (K, 2) px.
    """

    image: Float[Array, "k n 2"]
    weights: Float[Array, "k n"]
    points: Float[Array, "n 3"]
    center: Float[Array, " 3"]
    sizes: Float[Array, "k 2"]
    principal: Float[Array, "k 2"]

    def of(self, keep: Bool[Array, " k"]) -> PoseProblem:
        """The same with some photos only."""
        return replace(
            self,
            image=self.image[keep],
            weights=self.weights[keep],
            sizes=self.sizes[keep],
            principal=self.principal[keep],
        )


def check_problem(
    image_points: Array,
    points: Array,
    sizes: Array,
    principal_px: Array | None,
    weights: Array | None,
) -> PoseProblem:
    """The arguments of recover_pose as a problem. Raises: InputError."""
    points = check_array("points", points, (None, 3))
    image = check_array("image_points", image_points, (None, len(points), 2), finite=False)
    sizes = check_array("sizes", sizes, (len(image), 2))
    if (sizes <= 0).any():
        raise InputError("sizes", "widths and heights above zero", sizes.min())
    principal = sizes / 2 if principal_px is None else principal_px
    principal = check_array("principal_px", principal, (len(image), 2))
    seen: Array = np.asarray(np.isfinite(image).all(axis=2))
    weights = check_array(
        "weights", np.ones(seen.shape) if weights is None else weights, seen.shape
    )
    if (weights < 0).any():
        raise InputError("weights", "numbers of 0 or more", weights.min())
    weights = np.where(seen, weights, 0.0)
    if weights.any():
        weights = weights / np.median(weights[weights > 0])
    used = weights.any(axis=0)
    center = points[used].mean(axis=0) if used.any() else np.zeros(3)
    relative = np.where(seen[..., None], image - principal[:, None], 0.0)
    return PoseProblem(relative, weights, points - center, center, sizes, principal)


def residual_lengths(problem: PoseProblem, solution: Alternation) -> Float[Array, "k n"]:
    """Reprojection errors in px; meaningless where unseen."""
    off = reprojection(solution.poses, solution.points) - problem.image
    return np.linalg.norm(off, axis=-1)


def weighted_lengths(problem: PoseProblem, solution: Alternation) -> Float[Array, "k n"]:
    """Reprojection errors as they would be with the median observation's variance, px."""
    return np.sqrt(problem.weights) * residual_lengths(problem, solution)


def joint_sigma(
    problem: PoseProblem, solution: Alternation, seen: Bool[Array, "k n"], *, robust: bool = True
) -> float:
    """Deviation in px per axis of the weighted errors, corrected for the number of unknowns."""
    shared = seen & (seen.sum(axis=0) >= 2)
    rows = 2 * np.count_nonzero(shared)
    unknowns = 7 * len(seen) - 7 + 3 * np.count_nonzero(shared.any(axis=0))
    if rows <= unknowns:
        return SIGMA_FLOOR_PX
    lengths = weighted_lengths(problem, solution)[shared]
    spread = robust_sigma(lengths) if robust else float(np.sqrt((lengths**2).mean() / 2))
    return max(spread * float(np.sqrt(rows / (rows - unknowns))), SIGMA_FLOOR_PX)


def moved_too_far(
    problem: PoseProblem, solution: Alternation, inliers: Bool[Array, "k n"]
) -> Bool[Array, " n"]:
    """Points that left the initial shape as no others did: two marks agreed on a wrong place."""
    determined = inliers.sum(axis=0) >= 2
    if np.count_nonzero(determined) < _MIN_ALIGNED:
        return np.zeros(len(determined), bool)
    move = estimate_similarity(solution.points[determined], problem.points[determined])
    moved = np.linalg.norm(move(solution.points) - problem.points, axis=1)
    limit = max(_MOVED_SIGMAS * robust_sigma(moved[determined], 3), _LEAST_LIMIT_MM)
    return determined & (moved > limit)


def rms_per_photo(
    problem: PoseProblem,
    solution: Alternation,
    inliers: Bool[Array, "k n"],
    *,
    weighted: bool = False,
) -> Float[Array, " k"]:
    """Root mean square length of each photo's inlier reprojection errors, px.

    Args:
        problem: what was solved.
        solution: of it.
        inliers: (K, N) observations that count.
        weighted: count an error as what it would be for an observation of the largest weight.
    """
    squared = np.where(inliers, residual_lengths(problem, solution) ** 2, 0.0)
    if weighted:
        squared *= problem.weights / max(float(problem.weights.max()), np.finfo(float).tiny)
    return np.sqrt(squared.sum(axis=1) / np.maximum(inliers.sum(axis=1), 1))
