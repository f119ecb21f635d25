"""Which examples make each subregion of an expression, and with which coefficients."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.errors import InputError
from mien.numeric.solvers.simplex import simplex_quadratic_program
from mien.synthesis.examples.example_set import ExampleSet

__all__ = [
    "BROWS",
    "DISTANCE_PENALTY",
    "UPPER_FACE",
    "coefficients",
    "coefficients_from_offsets",
    "example_offsets",
    "mixture_distances",
]

DISTANCE_PENALTY = 0.05
"""On both halves of two clips as near as 0.02 (-0.03 to 0.08 dB), and sharper."""

BROWS = ("forehead", "right_brow", "left_brow")
"""Frowns move them as one: on six halves of four clips tied 0.01 to 0.1 dB, never a loss."""

UPPER_FACE = (
    "forehead",
    "right_brow",
    "left_brow",
    "right_lids",
    "left_lids",
    "right_eye",
    "left_eye",
)
"""All above the nose. Fewer double brows than with `BROWS`; up to 0.3 dB less."""


class HasMembers(Protocol):
    """Subregions of a picture or of a mesh: their names and feature points."""

    @property
    def names(self) -> Sequence[str]:
        """R of them."""
        ...

    @property
    def members(self) -> Sequence[Int[Array, " k"]]:
        """Of each, the indices of its feature points."""
        ...


def coefficients(
    example_set: ExampleSet,
    points: Float[Array, "n 2"],
    *,
    distance_penalty: float = DISTANCE_PENALTY,
    slack: float = 0.0,
    tied: Sequence[Collection[str]] | None = None,
) -> Float[Array, "R m"]:
    """Each subregion's geometry as a mixture of the examples' geometries.

    Args:
        example_set: of the person.
        points: (n, 2) px of any photo, all that the layout has.
        distance_penalty: the paper has 0. Beyond it, what an example costs by its squared distance
            from the target geometry, those being 1 in the mean: of two mixtures that fit alike, the
            one of near examples wins: 0.0 to 0.3 dB by the mean of the frames on six halves of four
            clips. 0.2 takes up to 0.3 dB again and leaves more detail.
        slack: how far below 0 coefficients may fall; the paper has 0. More leaves the convex hull.
            With 40 examples 0.01 gives 0.1 dB on one clip and takes 1 on two; 0.05 takes 2 to 4 on
            all.
        tied: groups of subregions, by name, that share one row of coefficients, fitted to all their
            points; the paper has none: (). Unless given, `BROWS` where there are such subregions.

    Returns:
        (R, m) coefficients; each row sums to 1.

    Raises:
        InputError: shape, NaN, a negative penalty, a group that names no subregion or one of
            another group.
        EstimationError: all points in one place.

    Source:
        [Zhang 2006] section 6, eq. (2) to (5).
    """
    return coefficients_from_offsets(
        example_offsets(example_set, points),
        example_set.subregions,
        distance_penalty=distance_penalty,
        slack=slack,
        tied=tied,
        subsets=example_set.subsets,
    )


def coefficients_from_offsets(
    offsets: Float[Array, "m n d"],
    subregions: HasMembers,
    *,
    distance_penalty: float = DISTANCE_PENALTY,
    slack: float = 0.0,
    tied: Sequence[Collection[str]] | None = None,
    subsets: Mapping[str, Sequence[int]] | None = None,
) -> Float[Array, "R m"]:
    """The same of any geometries, in the plane or in space.

    Args:
        offsets: (m, n, d) the examples' geometries less the target geometry.
        subregions: whose members are some of the n points.
        distance_penalty: as for `coefficients`.
        slack: as for `coefficients`.
        tied: as for `coefficients`.
        subsets: by subregion, indices of the examples that it is made from where they are near:
            teeth from those that show teeth, unless the mouth is shut. In between, both mixtures
            are blended, so that a mouth opens without a jump. Tied subregions ignore it.

    Returns:
        (R, m) coefficients; each row sums to 1.

    Raises:
        InputError: as `coefficients`.

    Source:
        [Zhang 2006] section 6, eq. (2) to (5), section 9.
    """
    if not 0 <= distance_penalty < np.inf:
        raise InputError("distance_penalty", "a number of at least 0", distance_penalty)
    if not 0 <= slack < np.inf:
        raise InputError("slack", "a number of at least 0", slack)
    result = np.zeros((len(subregions.names), len(offsets)))
    for rows in _groups(subregions.names, tied):
        # Most groups are one subregion, and removing duplicates takes time.
        members = subregions.members[rows[0]]
        if len(rows) > 1:
            members = np.unique(np.concatenate([subregions.members[row] for row in rows]))
        flat = offsets[:, members].reshape(len(offsets), -1)
        gram = flat @ flat.T
        subset = (subsets or {}).get(subregions.names[rows[0]], ()) if len(rows) == 1 else ()
        weight = _subset_weight(gram.diagonal(), subset)
        if weight > 0:
            few = _mixture(gram[np.ix_(subset, subset)], distance_penalty, slack)
            result[rows[0], subset] = weight * few
        if weight < 1:
            result[rows] += (1 - weight) * _mixture(gram, distance_penalty, slack)
    return result


def _subset_weight(squares: Float[Array, " m"], subset: Sequence[int]) -> float:
    """How much of a subregion a subset of the examples makes alone, by the nearest's distance.

    1 where the squared distance of the others is three times theirs, 0.5 where both are as near,
    and 0 where it is a third.
    """
    if not subset:
        return 0.0
    others = np.delete(squares, subset)
    if not others.size:
        return 1.0
    near, far = squares[list(subset)].min(), others.min()
    return float(np.clip(0.5 + (far - near) / max(far + near, 1e-300), 0, 1))


def _mixture(gram: Float[Array, "m m"], distance_penalty: float, slack: float) -> Array:
    """Coefficients of the examples whose offsets have these inner products."""
    return simplex_quadratic_program(gram, slack=slack, penalty=distance_penalty * gram.diagonal())


def mixture_distances(
    offsets: Float[Array, "m n d"], coefficients: Float[Array, "R m"], subregions: HasMembers
) -> Float[Array, " R"]:
    """How far the mixtures of examples are from the target geometry.

    Args:
        offsets: as for `coefficients_from_offsets`.
        coefficients: of the examples in each subregion.
        subregions: as for `coefficients_from_offsets`.

    Returns:
        (R,) root of the mean squared distance of each subregion's points.
    """
    residuals = np.tensordot(coefficients, offsets, axes=1)
    squares = (residuals**2).sum(axis=2)
    pairs = zip(squares, subregions.members, strict=True)
    return np.sqrt([row[members].mean() for row, members in pairs])


def _groups(names: Sequence[str], tied: Sequence[Collection[str]] | None) -> list[list[int]]:
    """Rows of subregions that share coefficients; every subregion in one group."""
    if tied is None:
        tied = [BROWS] if set(BROWS) <= set(names) else []
    grouped = [name for group in tied for name in group]
    unknown = sorted(set(grouped) - set(names))
    if unknown:
        raise InputError("tied", f"subregions of {', '.join(names)}", unknown[0])
    if len(set(grouped)) < len(grouped):
        twice = next(name for name in grouped if grouped.count(name) > 1)
        raise InputError("tied", "each subregion in one group", f"{twice} twice")
    groups = [[names.index(name) for name in group] for group in tied if group]
    return groups + [[row] for row, name in enumerate(names) if name not in grouped]


def example_offsets(example_set: ExampleSet, points: Float[Array, "n 2"]) -> Float[Array, "m n 2"]:
    """The examples' geometries less the target geometry, px of the neutral photo.

    Args:
        example_set: of the person.
        points: (n, 2) px of any photo, those of the target.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    points = check_array("points", points, (len(example_set.layout.names), 2))
    return example_set.geometries - example_set.geometry(points)
