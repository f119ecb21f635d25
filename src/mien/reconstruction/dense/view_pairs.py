"""Which photos are matched with each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera

BEST_ANGLE_DEG = 20.0
"""Nearer views tell less of depth, farther ones look less alike."""
WIDEST_DEG = 65.0
SAME_SIDE_DEG = 8.0
"""Two neighbours this near to each other tell the same."""


def choose_pairs(cameras: Sequence[Camera], neighbours: int = 3) -> list[tuple[int, int]]:
    """Pairs (a, b), a < b, such that every photo has about so many partners and all hang together.

    A photo's partners are those about BEST_ANGLE_DEG off, on different sides of it where there
    are such; photos that would be left without a link get the nearest one.
    """
    axes = np.stack([camera.center / np.linalg.norm(camera.center) for camera in cameras])
    angles = np.degrees(np.arccos(np.clip(axes @ axes.T, -1, 1)))
    pairs: set[tuple[int, int]] = set()
    for k in range(len(cameras)):
        for other in _partners(k, angles, neighbours):
            pairs.add((min(k, other), max(k, other)))
    pairs |= _missing_links(pairs, angles)
    return sorted(pairs)


def _partners(k: int, angles: Float[Array, "k k"], count: int) -> list[int]:
    unsuitable = np.abs(np.log(np.maximum(angles[k], 0.1) / BEST_ANGLE_DEG))
    unsuitable[k] = np.inf
    unsuitable[angles[k] > WIDEST_DEG] = np.inf
    chosen: list[int] = []
    while len(chosen) < count:
        crowded = (angles[chosen] < SAME_SIDE_DEG).any(axis=0) if chosen else False
        # Rather another photo from the same side than none.
        cost = np.where(crowded, unsuitable + 10, unsuitable)
        cost[chosen] = np.inf
        best = int(cost.argmin())
        if not np.isfinite(cost[best]):
            break
        chosen.append(best)
    return chosen


def _missing_links(pairs: set[tuple[int, int]], angles: Array) -> set[tuple[int, int]]:
    """The shortest links that join what is apart, while they are not too wide."""
    group = np.arange(len(angles))
    for a, b in pairs:
        group[group == group[b]] = group[a]
    links: set[tuple[int, int]] = set()
    while True:
        apart = np.where(group[:, None] != group, angles, np.inf)
        a, b = divmod(int(apart.argmin()), len(apart))
        if apart[a, b] > WIDEST_DEG:
            return links
        links.add((min(a, b), max(a, b)))
        group[group == group[b]] = group[a]
