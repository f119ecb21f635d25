"""The displacements of all feature points from those of some: result, interface, input checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from mien.arrays import Array, Float, Int, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError

__all__ = [
    "MIN_NOISE",
    "DisplacementModel",
    "InferredMotion",
    "KnownPoints",
    "check_known",
    "check_statistics",
    "point_indices",
]

MIN_NOISE = 0.1
"""Px or mm, the least standard deviation of the noise, also where the principal components explain
the statistics wholly."""

KnownPoints = Mapping[str, ArrayLike] | Sequence[str] | Int[Array, " k"]
"""Positions by the points' names; or names or indices of points, whose positions are beside."""


@dataclass(frozen=True)
class InferredMotion:
    """The displacements of all points.

    Attributes:
        displacements: (n, d) from the neutral face, px in a picture, mm in space. Those of the
            known points are the model's, too, and differ from what was given.
        errors: (I,) after each iteration, the mean distance at the known points from what was given
            for them.
    """

    displacements: Float[Array, "n d"]
    errors: Float[Array, " i"]

    @property
    def iterations(self) -> int:
        """How many it took."""
        return len(self.errors)


class DisplacementModel(Protocol):
    """A statistical model of displacements, learned from a person's expressions."""

    def infer(self, known: Int[Array, " k"], displacements: Float[Array, "k d"]) -> InferredMotion:
        """The displacements of all points from those of some."""
        ...


def check_statistics(value: object) -> Float[Array, "m n d"]:
    """Displacements of all points in two expressions or more.

    Raises:
        InputError: fewer, no point, NaN.
    """
    statistics = check_array("statistics", value, (None, None, None))
    if len(statistics) < 2:
        raise InputError("statistics", "2 expressions or more", len(statistics))
    if statistics.shape[1] == 0 or statistics.shape[2] == 0:
        raise InputError("statistics", "at least one point", "none")
    return statistics


def point_indices(
    layout: FeatureLayout, known: KnownPoints, positions: ArrayLike | None
) -> tuple[object, object]:
    """Indices of points that may be given by name, and their positions.

    Args:
        layout: of the points.
        known: as for `Synthesizer.complete`.
        positions: as for `Synthesizer.complete`.

    Returns:
        (k,) indices of the points; (k, d) their positions.

    Raises:
        InputError: a name that is unknown, positions twice or not at all.
    """
    if isinstance(known, Mapping):
        if positions is not None:
            raise InputError("positions", "none beside positions by name", "some")
        return [layout.index(name) for name in known], list(known.values())
    if positions is None:
        raise InputError("positions", "one for each of the points", "none")
    names = [name for name in known if isinstance(name, str)]
    return [layout.index(name) for name in names] if names else known, positions


def check_known(
    known: object, displacements: object, count: int, axes: int = 2
) -> tuple[Int[Array, " k"], Float[Array, "k d"]]:
    """Indices of some of `count` points, in rising order, and their displacements along `axes`.

    Raises:
        InputError: none, one that is not there, one twice, shapes, NaN.
    """
    indices = np.asarray(known)
    if indices.ndim != 1 or indices.size == 0:
        raise InputError("known", "indices of at least one point", f"shape {indices.shape}")
    if indices.dtype.kind not in "iu":
        raise InputError("known", "indices of points", f"numbers of type {indices.dtype}")
    outside = indices[(indices < 0) | (indices >= count)]
    if outside.size:
        raise InputError("known", f"points from 0 to {count - 1}", outside[0])
    order = np.argsort(indices)
    given = check_array("displacements", displacements, (len(indices), axes))
    twice = indices[order][1:][np.diff(indices[order]) == 0]
    if twice.size:
        raise InputError("known", "each point once", f"point {twice[0]} twice")
    return indices[order], given[order]
