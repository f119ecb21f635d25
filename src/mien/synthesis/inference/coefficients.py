"""Which examples make each subregion of an expression, and in which share."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.errors import InputError
from mien.numeric.solvers.simplex import nearest_mixture
from mien.synthesis.examples.example_set import ExampleSet

__all__ = [
    "BROWS",
    "DISTANCE_PENALTY",
    "UPPER_FACE",
    "apart_from",
    "coefficients",
    "coefficients_of",
    "distances_of",
    "hull_distances",
]

DISTANCE_PENALTY = 0.05
"""On both halves of two clips as near as 0.02 (-0.03 to 0.08 dB), and sharper."""

BROWS = ("forehead", "right_brow", "left_brow")
"""Frowns move them as one: on six halves of four clips together 0.01 to 0.1 dB, never a loss."""

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
    """Subregions of a picture or of a mesh: all that is asked of them here."""

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def members(self) -> Sequence[Int[Array, " k"]]: ...


def coefficients(
    example_set: ExampleSet,
    points: Float[Array, "n 2"],
    *,
    distance_penalty: float = DISTANCE_PENALTY,
    slack: float = 0.0,
    together: Sequence[Collection[str]] | None = None,
) -> Float[Array, "R m"]:
    """Each subregion's geometry as a mix of the examples' geometries.

    Args:
        points: (n, 2) px of any photo, all that the layout has.
        distance_penalty: the paper has 0. Beyond it, what an example costs by its squared distance
            from the geometry asked for, those being 1 in the mean: of two mixes that fit alike, the
            one of near examples wins: 0.0 to 0.3 dB by the mean of the frames on six halves of four
            clips. 0.2 takes up to 0.3 dB again and leaves more detail.
        together: groups of subregions, by name, that get the same shares, from all their points;
            the paper has none: (). Unless given, `BROWS` where there are such subregions.
        slack: how far below 0 shares may fall; the paper has 0. More leaves the convex hull. With
            40 examples 0.01 gives 0.1 dB on one clip and takes 1 on two; 0.05 takes 2 to 4 on all.

    Returns:
        (R, m) shares; each row sums to 1.

    Raises:
        InputError: shape, NaN, a negative penalty, a group that names no subregion or shares one
            with another.
        EstimationError: all points in one place.

    Source:
        [Zhang 2006] section 6, eq. (2) to (5).
    """
    return coefficients_of(
        apart_from(example_set, points),
        example_set.subregions,
        distance_penalty=distance_penalty,
        slack=slack,
        together=together,
        only=example_set.only,
    )


def coefficients_of(
    apart: Float[Array, "m n d"],
    subregions: HasMembers,
    *,
    distance_penalty: float = DISTANCE_PENALTY,
    slack: float = 0.0,
    together: Sequence[Collection[str]] | None = None,
    only: Mapping[str, Sequence[int]] | None = None,
) -> Float[Array, "R m"]:
    """The same of any geometries, in the plane or in space.

    Args:
        apart: (m, n, d) the examples' geometries relative to the one asked for.
        subregions: whose members are some of the n points.
        distance_penalty: as for `coefficients`.
        slack: as for `coefficients`.
        together: as for `coefficients`.
        only: the examples that a subregion is made from where they are near: teeth from those that
            show teeth, unless the mouth is shut. In between it is made from both, so that a mouth
            that opens does so without a jump. Not of those together with others.

    Raises:
        InputError: as `coefficients`.

    Source:
        [Zhang 2006] section 6, eq. (2) to (5), section 9.
    """
    if not 0 <= distance_penalty < np.inf:
        raise InputError("distance_penalty", "a number of at least 0", distance_penalty)
    if not 0 <= slack < np.inf:
        raise InputError("slack", "a number of at least 0", slack)
    shares = np.zeros((len(subregions.names), len(apart)))
    for rows in _groups(subregions.names, together):
        # Most groups are one subregion, and looking for what is double takes time.
        members = subregions.members[rows[0]]
        if len(rows) > 1:
            members = np.unique(np.concatenate([subregions.members[row] for row in rows]))
        offsets = apart[:, members].reshape(len(apart), -1)
        products = offsets @ offsets.T
        used = (only or {}).get(subregions.names[rows[0]], ()) if len(rows) == 1 else ()
        part = _share_of(products.diagonal(), used)
        if part > 0:
            few = _mixture(products[np.ix_(used, used)], distance_penalty, slack)
            shares[rows[0], used] = part * few
        if part < 1:
            shares[rows] += (1 - part) * _mixture(products, distance_penalty, slack)
    return shares


def _share_of(squares: Float[Array, " m"], used: Sequence[int]) -> float:
    """How much of a subregion some examples make alone, by the squared distance of the nearest.

    All where that of the others is three times theirs, half where both are as near, and nothing
    where it is a third.
    """
    if not used:
        return 0.0
    others = np.delete(squares, used)
    if not others.size:
        return 1.0
    near, far = squares[list(used)].min(), others.min()
    return float(np.clip(0.5 + (far - near) / max(far + near, 1e-300), 0, 1))


def _mixture(products: Float[Array, "m m"], distance_penalty: float, slack: float) -> Array:
    """Shares of the examples whose offsets have these products."""
    penalty = distance_penalty * products.diagonal()
    return nearest_mixture(products, slack=slack, penalty=penalty)


def distances_of(
    apart: Float[Array, "m n d"], shares: Float[Array, "R m"], subregions: HasMembers
) -> Float[Array, " R"]:
    """How far the mixes of examples are from the geometry asked for.

    Args:
        apart: as for `coefficients_of`.
        shares: of the examples in each subregion.

    Returns:
        (R,) root of the mean squared distance of each subregion's points.
    """
    missed = np.tensordot(shares, apart, axes=1)
    squares = (missed**2).sum(axis=2)
    parts = zip(squares, subregions.members, strict=True)
    return np.sqrt([row[members].mean() for row, members in parts])


def _groups(names: Sequence[str], together: Sequence[Collection[str]] | None) -> list[list[int]]:
    """Rows of subregions that get the same shares; every subregion in one group."""
    if together is None:
        together = [BROWS] if set(BROWS) <= set(names) else []
    grouped = [name for group in together for name in group]
    unknown = sorted(set(grouped) - set(names))
    if unknown:
        raise InputError("together", f"subregions of {', '.join(names)}", unknown[0])
    if len(set(grouped)) < len(grouped):
        twice = next(name for name in grouped if grouped.count(name) > 1)
        raise InputError("together", "each subregion in one group", f"{twice} twice")
    groups = [[names.index(name) for name in group] for group in together if group]
    return groups + [[row] for row, name in enumerate(names) if name not in grouped]


def hull_distances(example_set: ExampleSet, points: Float[Array, "n 2"]) -> Float[Array, " R"]:
    """How far each subregion's geometry is from any mix of examples: from 2 px on it shows.

    Args:
        points: (n, 2) px of any photo.

    Returns:
        (R,) root of the mean squared distance of the subregion's points, px of the neutral photo.

    Raises:
        as `coefficients`.
    """
    apart = apart_from(example_set, points)
    shares = coefficients_of(apart, example_set.subregions, distance_penalty=0.0, together=())
    return distances_of(apart, shares, example_set.subregions)


def apart_from(example_set: ExampleSet, points: Float[Array, "n 2"]) -> Float[Array, "m n 2"]:
    """The examples' geometries relative to the one asked for, px of the neutral photo.

    Args:
        points: (n, 2) px of any photo.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    points = check_array("points", points, (len(example_set.layout.names), 2))
    return example_set.geometries - example_set.geometry(points)
