"""The motion of all feature points from that of a few, as [Zhang 2006] prints it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array, check_positive, frozen
from mien.errors import InputError
from mien.numeric.pca import Pca, fit_pca
from mien.synthesis.inference.displacement_model import (
    MIN_NOISE,
    InferredMotion,
    check_known,
    check_statistics,
)

__all__ = ["COMPONENTS", "MotionPropagation", "PointSets", "visiting_order"]

COMPONENTS = (20, 15, 15)
"""Of the sets of each hierarchy. [Zhang 2006] keeps 5 to 10 of 30 to 40 images; clips have more."""

PointSets = Sequence[Sequence[Int[Array, " s"]]]
"""For each hierarchy, from 0 on, its sets of indices of feature points."""


class HasPointSets(Protocol):
    """A layout of feature points."""

    @property
    def sets(self) -> PointSets:
        """Of its points, by hierarchy."""
        ...


class MotionPropagation:
    """Motion propagation: projections onto the principal components of sets of points, in turn.

    Each iteration puts the known displacements back and projects one set after another onto its
    principal components. So the motion of known points spreads from the sets they are in, across
    hierarchies, to those that share points with them.

    Args:
        layout: its point sets, by hierarchy.
        statistics: (N, n, d) displacements from the neutral face of expressions of the same person,
            head motion compensated, px in a picture and mm in space; N >= 2.
        components: how many principal components the sets keep: one number, or one for each
            hierarchy.
        known_weight: in the projection of a set, the total weight of its known points, where all
            its points at 1 each weigh 1, and none less than 1; 0 is as printed. With more, the
            known displacements last longer than the inferred ones, and fewer iterations are needed.
        prior_weight: of the normal distribution of the components' weights, with what the
            components leave as the noise; 0 is as printed, 1 gives the most likely displacements.
            With it, more components do good where they overfit without.
        threshold: px or mm; the propagation stops when an iteration changes the displacements of
            the known points by less than this, on the average of two.
        max_iterations: it stops after so many in any case.

    Raises:
        InputError: shapes, NaN, too few statistics, sets of other points, options out of their
            range.

    Source:
        [Zhang 2006] sec. 10 and 10.1. Left open there: components are about the mean; siblings are
        visited in the order of the layout; progress is how far the points of T moved since the
        iteration before. `known_weight` and `prior_weight` go beyond it.
    """

    def __init__(
        self,
        layout: HasPointSets,
        statistics: Float[Array, "m n d"],
        *,
        components: int | Sequence[int] = COMPONENTS,
        known_weight: float = 0.0,
        prior_weight: float = 0.0,
        threshold: float = 1e-3,
        max_iterations: int = 50,
    ) -> None:
        statistics = check_statistics(statistics)
        self._shape = statistics.shape[1:]
        self._sets = _check_sets(layout.sets, len(statistics[0]))
        self._known_weight = _check_not_negative("known_weight", known_weight)
        self._prior_weight = _check_not_negative("prior_weight", prior_weight)
        self._threshold = check_positive("threshold", threshold)
        if max_iterations < 1:
            raise InputError("max_iterations", "a number from 1 on", max_iterations)
        self._max_iterations = max_iterations
        self._components = _fit_components(statistics, self._sets, components)

    def infer(self, known: Int[Array, " k"], displacements: Float[Array, "k d"]) -> InferredMotion:
        """The displacements of all points from those of some, in any order.

        Points that no set contains or that no chain of sets joins to the known ones do not move.

        Args:
            known: indices of points, none twice.
            displacements: (k, d) from the neutral face, head motion compensated.

        Raises:
            InputError: no points, unknown or repeated ones, NaN, none in any set.

        Source:
            [Zhang 2006] sec. 10.1, `MotionPropagation`.
        """
        known, given = check_known(known, displacements, *self._shape)
        projections = self._projections(known)
        moved = np.zeros(self._shape)
        errors: list[float] = []
        progress: list[float] = []
        while not self._stops(progress):
            before = moved[known]
            moved[known] = given
            for projection in projections:
                projection.update(moved)
            errors.append(_distance(moved[known], given))
            progress.append(_distance(moved[known], before))
        return InferredMotion(frozen(moved), frozen(np.array(errors)))

    def _projections(self, known: Int[Array, " k"]) -> list[_Projection]:
        """One for each set that is reached, in the order of an iteration."""
        is_known = np.isin(np.arange(self._shape[0]), known)
        return [
            self._projection(self._sets[level][index], self._components[level][index], is_known)
            for level, index in visiting_order(self._sets, known)
        ]

    def _projection(
        self, points: Int[Array, " s"], pca: Pca, is_known: Bool[Array, " n"]
    ) -> _Projection:
        """Weighted, regularised least squares over the numbers of a set."""
        count = np.count_nonzero(is_known[points])
        weight = max(1.0, self._known_weight * len(points) / count) if count else 1.0
        weights = np.repeat(np.where(is_known[points], weight, 1.0), self._shape[1])
        weighted = pca.components * weights
        # Relative to the noise of known points, so that their weight leaves that of the prior.
        noise = weight * max(pca.residual, MIN_NOISE) ** 2
        regularisation = np.diag(self._prior_weight * noise / pca.deviations**2)
        gain = np.linalg.solve(weighted @ pca.components.T + regularisation, weighted)
        return _Projection(points, pca.mean, gain, pca.components)

    def _stops(self, progress: Sequence[float]) -> bool:
        """Whether the average progress on two consecutive iterations is too small."""
        if len(progress) >= self._max_iterations:
            return True
        return len(progress) >= 2 and (progress[-2] + progress[-1]) / 2 < self._threshold


@dataclass(frozen=True)
class _Projection:
    """Proj(dV, F): the displacements of a set in the span of its components that fit best."""

    points: Int[Array, " s"]
    mean: Float[Array, " d"]
    gain: Float[Array, "c d"]
    components: Float[Array, "c d"]

    def update(self, moved: Float[Array, "n d"]) -> None:
        """Replace the displacements of the set's points, in place."""
        weights = self.gain @ (moved[self.points].ravel() - self.mean)
        projected = self.mean + weights @ self.components
        moved[self.points] = projected.reshape(len(self.points), -1)


def visiting_order(sets: PointSets, known: Int[Array, " k"]) -> list[tuple[int, int]]:
    """The sets, as (hierarchy, number in it), in the order in which an iteration projects them.

    It depends only on which sets share points, so once is enough for all iterations.

    Args:
        sets: of points, by hierarchy.
        known: indices of points.

    Raises:
        InputError: no set contains a known point.

    Source:
        [Zhang 2006] sec. 10.1, `MotionPropagationFeaturePointSet` with its flag hasBeenProcessed.
    """
    members = {
        (level, index): set(points.tolist())
        for level, of_level in enumerate(sets)
        for index, points in enumerate(of_level)
    }
    start = next((node for node in members if members[node] & set(known.tolist())), None)
    if start is None:
        raise InputError("known", "a point that belongs to a set of points", known.tolist())
    processed: list[tuple[int, int]] = []

    def propagate(node: tuple[int, int]) -> None:
        if node in processed:
            return
        processed.append(node)
        for level in (node[0] - 1, node[0] + 1):
            for other in members:
                if other[0] == level and members[other] & members[node]:
                    propagate(other)

    propagate(start)
    return processed


def _check_sets(sets: PointSets, count: int) -> list[list[Int[Array, " s"]]]:
    checked = [[np.asarray(points, dtype=np.intp) for points in level] for level in sets]
    if not any(checked):
        raise InputError("layout", "at least one set of points", "none")
    for points in (points for level in checked for points in level):
        if points.size == 0 or points.min() < 0 or points.max() >= count:
            raise InputError("statistics", "all points of the layout's sets", f"{count} points")
    return checked


def _fit_components(
    statistics: Array, sets: PointSets, components: int | Sequence[int]
) -> list[list[Pca]]:
    """Each set's principal components."""
    counts = [components] * len(sets) if isinstance(components, int) else list(components)
    if len(counts) != len(sets):
        raise InputError("components", f"one number, or {len(sets)} for as many levels", counts)
    return [
        [fit_pca(statistics[:, points].reshape(len(statistics), -1), count) for points in level]
        for level, count in zip(sets, counts, strict=True)
    ]


def _check_not_negative(name: str, value: float) -> float:
    number = float(check_array(name, value, ()))
    if number < 0:
        raise InputError(name, "a number of 0 or more", value)
    return number


def _distance(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b, axis=1).mean())
