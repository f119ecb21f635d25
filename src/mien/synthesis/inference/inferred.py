"""What a few points tell of all: the result, and what every way to it asks of its input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.errors import InputError

__all__ = ["LEAST_NOISE", "Inference", "Inferred", "check_known", "check_statistics"]

LEAST_NOISE = 0.1
"""Px or mm: statistics that components explain wholly do not put given points beyond doubt."""


@dataclass(frozen=True)
class Inferred:
    """The displacements of all points.

    Attributes:
        displacements: (n, d) from the neutral face, px in a picture, mm in space. The known points,
            too, are where the statistics put them; who wants them where they were given puts them
            back.
        errors: (I,) after each iteration, the mean distance at the known points from what was given
            for them.
    """

    displacements: Float[Array, "n d"]
    errors: Float[Array, " i"]

    @property
    def iterations(self) -> int:
        """How many it took."""
        return len(self.errors)


class Inference(Protocol):
    """A way to the displacements of all points from those of some."""

    def infer(self, known: Int[Array, " k"], displacements: Float[Array, "k d"]) -> Inferred: ...


def check_statistics(value: object) -> Float[Array, "m n d"]:
    """Displacements of all points in two expressions or more. Raises: InputError."""
    statistics = check_array("statistics", value, (None, None, None))
    if len(statistics) < 2:
        raise InputError("statistics", "2 expressions or more", len(statistics))
    if statistics.shape[1] == 0 or statistics.shape[2] == 0:
        raise InputError("statistics", "at least one point", "none")
    return statistics


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
