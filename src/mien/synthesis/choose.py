"""Which frames become examples: sharp ones that face the camera and differ most by subregion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.errors import InputError

__all__ = ["ExampleCandidates", "ExampleChoice", "choose_examples"]

_LEAST_SHARPNESS = 0.5
"""A frame with less than this share of the median sharpness is blurred."""


@dataclass(frozen=True)
class ExampleCandidates:
    """Photos or frames of one person that may become examples.

    Attributes:
        geometries: (N, n, 2) feature points with head motion taken out, px of the neutral photo.
        sharpness: (N,) any measure that grows with it.
        pose: (N, 2) yaw and pitch, radians.
    Raises: InputError: shapes, NaN.
    """

    geometries: Float[Array, "N n 2"]
    sharpness: Float[Array, " N"]
    pose: Float[Array, "N 2"]

    def __post_init__(self) -> None:
        """Check that all describe the same photos."""
        count = len(check_array("geometries", self.geometries, (None, None, 2)))
        check_array("sharpness", self.sharpness, (count,))
        check_array("pose", self.pose, (count, 2))


@dataclass(frozen=True)
class ExampleChoice:
    """The photos chosen, and why.

    Attributes:
        rows: (m,) of the candidates, neutral first, then the most different first.
        reasons: one of each candidate, chosen or not.
    """

    rows: Int[Array, " m"]
    reasons: tuple[str, ...]


def choose_examples(
    candidates: ExampleCandidates,
    regions: Sequence[tuple[str, Int[Array, " k"]]],
    neutral: int,
    *,
    count: int = 40,
    max_turn: float = np.radians(25),
) -> ExampleChoice:
    """Neutral, and again and again the photo least like any chosen so far.

    Photos are compared by subregion, each in units of how much it moves at all: brows, which move
    by little, count as much as the mouth.

    Args:
        regions: name of each subregion and the indices of its points.
        neutral: the row of the face at rest, chosen whatever its picture is like.
        count: of examples at most; fewer when all others are left out or equal a chosen one. The
            paper has 10 to 15; on two clips 15 gave 3.2 and 3.5 dB over the warp of neutral,
            40 gave 5.2 and 4.0, 80 gave 5.8 and 4.9.
        max_turn: yaw or pitch away from neutral, radians, from which parts of the face are hidden.
    Raises: InputError: no such neutral, count not positive, a region without points.
    Source: Z06 section 14, "sufficiently different from each other while covering all".
    """
    total = len(candidates.geometries)
    if not 0 <= neutral < total:
        raise InputError("neutral", f"one of {total} candidates, from 0", neutral)
    if count < 1:
        raise InputError("count", "a number above zero", count)
    reasons = _left_out(candidates, neutral, max_turn)
    reasons[neutral] = "neutral"
    usable = np.array([not reason for reason in reasons])
    return _farthest(_Distances(candidates.geometries, regions), usable, reasons, neutral, count)


def _farthest(
    distances: _Distances, usable: Array, reasons: list[str], neutral: int, count: int
) -> ExampleChoice:
    """Whichever usable one is farthest from all chosen so far, until there are enough."""
    chosen = [neutral]
    nearest, owner = distances.to(neutral), np.full(len(usable), neutral)
    usable = usable.copy()
    while len(chosen) < count and usable.any():
        row = int(np.where(usable, nearest, -1.0).argmax())
        if nearest[row] <= 0:
            break
        name = distances.largest(row, int(owner[row]))
        reasons[row] = f"chosen as number {len(chosen) + 1}, for the {name}"
        chosen.append(row)
        usable[row] = False
        apart = distances.to(row)
        owner = np.where(apart < nearest, row, owner)
        nearest = np.minimum(apart, nearest)
    for left in np.flatnonzero(usable).tolist():
        reasons[left] = f"like candidate {owner[left]}"
    return ExampleChoice(np.array(chosen), tuple(reasons))


def _left_out(candidates: ExampleCandidates, neutral: int, max_turn: float) -> list[str]:
    """Why each cannot be an example; empty where it can."""
    turned = np.abs(candidates.pose - candidates.pose[neutral]).max(axis=1)
    share = candidates.sharpness / np.median(candidates.sharpness)
    return [
        f"turned away by {np.degrees(turn):.0f} degrees"
        if turn > max_turn
        else f"blurred, {sharp:.0%} of the usual sharpness"
        if sharp < _LEAST_SHARPNESS
        else ""
        for turn, sharp in zip(turned, share, strict=True)
    ]


class _Distances:
    """How unlike candidates are, summed over subregions."""

    def __init__(
        self, geometries: Float[Array, "N n 2"], regions: Sequence[tuple[str, Int[Array, " k"]]]
    ) -> None:
        self._names = [name for name, _ in regions]
        self._parts = [_unit_spread(name, geometries, members) for name, members in regions]

    def to(self, row: int) -> Float[Array, " N"]:
        """From every candidate to one."""
        total: Array = self._by_region(row).sum(axis=0)
        return total

    def largest(self, row: int, other: int) -> str:
        """The subregion in which both differ most."""
        return self._names[int(self._by_region(other)[:, row].argmax())]

    def _by_region(self, row: int) -> Float[Array, "R N"]:
        return np.stack([((part - part[row]) ** 2).sum(axis=1) for part in self._parts])


def _unit_spread(
    name: str, geometries: Float[Array, "N n 2"], members: Int[Array, " k"]
) -> Float[Array, "N d"]:
    if not len(members):
        raise InputError(f"subregion {name}", "at least one point", "none")
    part = geometries[:, members].reshape(len(geometries), -1)
    part = part - part.mean(axis=0)
    spread = float(np.sqrt((part**2).sum(axis=1).mean()))
    scaled: Array = part / spread if spread > 0 else part
    return scaled
