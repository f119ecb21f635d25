"""Which examples make each subregion of an expression, and in which share."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.errors import InputError
from mien.numeric.simplex import simplex_least_squares
from mien.synthesis.examples import ExampleSet

__all__ = ["coefficients", "hull_distances"]


def coefficients(
    example_set: ExampleSet,
    points: Float[Array, "n 2"],
    *,
    distance_penalty: float = 0.02,
    slack: float = 0.0,
) -> Float[Array, "R m"]:
    """Each subregion's geometry as a mix of the examples' geometries.

    Args:
        points: (n, 2) px of any photo, all that the layout has.
        distance_penalty: the paper has 0. Beyond it, what an example costs by its squared distance
            from the geometry asked for, those being 1 in the mean: of two mixes that fit alike,
            the one of near examples wins, which is less blurred. On clips this gives 0 to 0.8 dB;
            from 0.3 on it takes as much.
        slack: how far below 0 shares may fall; the paper has 0. More leaves the convex hull.
    Returns: (R, m) shares; each row sums to 1.
    Raises: InputError: shape, NaN, a negative penalty. EstimationError: all points in one place.
    Source: Z06 section 6, eq. (2) to (5).
    """
    if not distance_penalty >= 0:
        raise InputError("distance_penalty", "a number from 0 on", distance_penalty)
    rows = []
    for offsets in _offsets(example_set, points):
        apart = (offsets**2).sum(axis=0)
        size = float(apart.mean()) or 1.0
        penalty = distance_penalty * apart / size
        target = np.zeros(len(offsets))
        # Relative to the target, for shares sum to 1: rounding is then that of small numbers.
        scaled = offsets / np.sqrt(size)
        rows.append(simplex_least_squares(scaled, target, slack=slack, penalty=penalty))
    return np.stack(rows)


def hull_distances(example_set: ExampleSet, points: Float[Array, "n 2"]) -> Float[Array, " R"]:
    """How far each subregion's geometry is from any mix of examples: from 2 px on it shows.

    Args:
        points: (n, 2) px of any photo.
    Returns: (R,) root of the mean squared distance of the subregion's points, px of the neutral
        photo.
    Raises: as `coefficients`.
    """
    shares = coefficients(example_set, points, distance_penalty=0.0)
    parts = zip(_offsets(example_set, points), shares, strict=True)
    return np.array([np.sqrt(2 * np.mean((offsets @ row) ** 2)) for offsets, row in parts])


def _offsets(example_set: ExampleSet, points: Float[Array, "n 2"]) -> list[Float[Array, "d m"]]:
    """Of each subregion, the examples' geometries relative to the one asked for."""
    points = check_array("points", points, (len(example_set.layout.names), 2))
    apart = example_set.geometries - example_set.geometry(points)
    count = len(apart)
    return [apart[:, members].reshape(count, -1).T for members in example_set.subregions.members]
