"""A made-up face of 24 points whose expressions lie in a subspace that is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

POINTS = 24
_ALL = np.arange(POINTS)
LAYOUT = SimpleNamespace(
    sets=(
        (_ALL,),
        (_ALL[:13], _ALL[11:]),
        (_ALL[:7], _ALL[5:13], _ALL[11:18], _ALL[16:]),
    )
)
"""One set, two halves, four quarters; neighbours share two points."""


def expressions(rng, rank=4, *, count=60, noise=0.0):
    """(count, 24, 2) px: mixtures of `rank` motions about a mean one."""
    motions = 6 * rng.normal(size=(rank, POINTS, 2))
    mixed = np.tensordot(rng.normal(size=(count, rank)), motions, axes=1)
    return 2 * rng.normal(size=(POINTS, 2)) + mixed + noise * rng.normal(size=mixed.shape)
