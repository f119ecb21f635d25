"""Which frames become examples: sharp ones that face the camera and differ most by subregion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array
from mien.errors import InputError

__all__ = ["COUNT", "DETECTOR_NOISE", "ExampleCandidates", "ExampleChoice", "choose_examples"]

COUNT = 60
"""Examples at most. With 15, 40, 80 of d10 held-out pictures were 3.2, 5.2, 5.8 dB nearer than
the warp of neutral, of d6 3.6, 4.0, 4.9: of what these clips have to show, more still pay."""

DETECTOR_NOISE = 0.001
"""How far a subregion's points jump between frames of a face that rests, in widths of the face:
0.0003 to 0.0014 on four clips (root mean square, second differences, the calmest tenth)."""

MAX_TURN = float(np.radians(25))
"""Yaw or pitch away from neutral from which parts of the face are hidden."""

_LEAST_SHARPNESS = 0.5
"""A frame with less than this share of the median sharpness is blurred."""


@dataclass(frozen=True)
class ExampleCandidates:
    """Photos or frames of one person that may become examples.

    Attributes:
        geometries: (N, n, 2) feature points with head motion taken out, px of the neutral photo.
        sharpness: (N,) any measure that grows with it.
        pose: (N, 2) yaw and pitch, radians.
        names: of the pictures, for reasons; "candidate 12" where there are none.
        unfit: why a picture cannot be an example, known beforehand; empty where it can.

    Raises:
        InputError: shapes, NaN.
    """

    geometries: Float[Array, "N n 2"]
    sharpness: Float[Array, " N"]
    pose: Float[Array, "N 2"]
    names: tuple[str, ...] = ()
    unfit: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that all describe the same photos."""
        count = len(check_array("geometries", self.geometries, (None, None, 2)))
        check_array("sharpness", self.sharpness, (count,))
        check_array("pose", self.pose, (count, 2))
        for name in ("names", "unfit"):
            texts = getattr(self, name)
            if texts and len(texts) != count:
                raise InputError(name, f"one for each of {count} candidates", len(texts))

    def left_out(self, neutral: int, max_turn: float = MAX_TURN) -> list[str]:
        """Why each cannot be an example; empty where it can."""
        turned = np.abs(self.pose - self.pose[neutral]).max(axis=1)
        usual = float(np.median(self.sharpness))
        # Where most pictures have nothing sharp in them, none is left out for it.
        share = self.sharpness / usual if usual > 0 else np.ones(len(self.sharpness))
        known = self.unfit or ("",) * len(self.geometries)
        return [
            reason
            or (f"turned away by {np.degrees(turn):.0f} degrees" if turn > max_turn else "")
            or (f"blurred, {sharp:.0%} of the usual sharpness" * bool(sharp < _LEAST_SHARPNESS))
            for turn, sharp, reason in zip(turned, share, known, strict=True)
        ]

    def name(self, row: int) -> str:
        """What reasons call a candidate."""
        return self.names[row] if self.names else f"candidate {row}"


@dataclass(frozen=True)
class ExampleChoice:
    """The photos chosen, and why.

    Attributes:
        rows: (m,) of the candidates: neutral, those that were asked for, then the most different
            first.
        reasons: one of each candidate, chosen or not.
        sound: (N,) whether a candidate might have been chosen: neither blurred nor turned away nor
            unfit nor excluded.
    """

    rows: Int[Array, " m"]
    reasons: tuple[str, ...]
    sound: Bool[Array, " N"]


def choose_examples(
    candidates: ExampleCandidates,
    regions: Sequence[tuple[str, Int[Array, " k"]]],
    neutral: int,
    *,
    count: int = COUNT,
    least: float = 0.0,
    max_turn: float = MAX_TURN,
    wanted: dict[int, str] | None = None,
    exclude: Sequence[int] = (),
) -> ExampleChoice:
    """Neutral, and again and again the photo least like any chosen so far.

    Photos are compared by subregion, each in units of how much it moves at all: brows, which move
    by little, count as much as the mouth.

    Args:
        regions: name of each subregion and the indices of its points.
        neutral: the row of the face at rest, chosen whatever its picture is like.
        count: of examples at most; fewer when all others are left out or are like a chosen one. The
            paper has 10 to 15.
        least: px, root mean square over the points of a subregion; a photo that differs from a
            chosen one by less in every subregion is like it.
        max_turn: yaw or pitch away from neutral, radians, that an example may have at most.
        wanted: rows that are chosen whatever they are like, with the reason.
        exclude: rows that are not.

    Raises:
        InputError: no such row, count not positive, a region without points.

    Source:
        [Zhang 2006] section 14, "sufficiently different from each other while covering all".
    """
    total = len(candidates.geometries)
    wanted = {neutral: "neutral"} | (wanted or {})
    _check_rows(total, neutral, wanted, exclude)
    if count < 1:
        raise InputError("count", "a number above zero", count)
    reasons = candidates.left_out(neutral, max_turn)
    for row in exclude:
        reasons[row] = "excluded"
    sound = np.array([not reason for reason in reasons])
    for row, reason in wanted.items():
        reasons[row] = reason
    usable = sound.copy()
    usable[list(wanted)] = False
    distances = _Distances(candidates.geometries, regions, least)
    rows = _farthest(distances, usable, candidates, reasons, list(wanted), count)
    return ExampleChoice(np.array(rows), tuple(reasons), sound)


def _check_rows(total: int, neutral: int, wanted: dict[int, str], exclude: Sequence[int]) -> None:
    for name, rows in (("neutral", [neutral]), ("wanted", [*wanted]), ("exclude", exclude)):
        for row in rows:
            if not 0 <= row < total:
                raise InputError(name, f"one of {total} candidates, from 0", row)
    for row in exclude:
        if row in wanted:
            raise InputError("exclude", "others than those that are wanted", wanted[row])


def _farthest(
    distances: _Distances,
    usable: Bool[Array, " N"],
    candidates: ExampleCandidates,
    reasons: list[str],
    chosen: list[int],
    count: int,
) -> list[int]:
    """Whichever usable one is farthest from all chosen so far, until there are enough."""
    nearest, owner = distances.to(chosen[0]), np.full(len(usable), chosen[0])

    def take(row: int) -> None:
        nonlocal nearest, owner
        apart = distances.to(row)
        owner = np.where(apart < nearest, row, owner)
        nearest = np.minimum(apart, nearest)

    for row in chosen[1:]:
        take(row)
    while len(chosen) < count and usable.any():
        row = int(np.where(usable, nearest, -1.0).argmax())
        other = int(owner[row])
        usable[row] = False
        if not distances.differ(row, other):
            reasons[row] = f"like {candidates.name(other)}"
            continue
        chosen.append(row)
        reasons[row] = f"chosen as number {len(chosen)}, for the {distances.largest(row, other)}"
        take(row)
    for left in np.flatnonzero(usable).tolist():
        other = int(owner[left])
        kind = (
            "different, but beyond the count; nearest is"
            if distances.differ(left, other)
            else "like"
        )
        reasons[left] = f"{kind} {candidates.name(other)}"
    return chosen


class _Distances:
    """How unlike candidates are, summed over subregions.

    Args:
        least: px by which two must differ to be different at all.
    """

    def __init__(
        self,
        geometries: Float[Array, "N n 2"],
        regions: Sequence[tuple[str, Int[Array, " k"]]],
        least: float,
    ) -> None:
        self._names = [name for name, _ in regions]
        parts = [_unit_spread(name, geometries, members, least) for name, members in regions]
        self._parts = [part for part, _ in parts]
        self._least = [least / spread for _, spread in parts]

    def to(self, row: int) -> Float[Array, " N"]:
        """From every candidate to one."""
        return self._by_region(row).sum(axis=0)

    def largest(self, row: int, other: int) -> str:
        """The subregion in which both differ most."""
        return self._names[int(self._between(row, other).argmax())].replace("_", " ")

    def differ(self, row: int, other: int) -> bool:
        """Whether they do in any subregion by more than they must."""
        apart = np.sqrt(self._between(row, other))
        return bool((apart > np.maximum(self._least, 1e-9)).any())

    def _between(self, row: int, other: int) -> Float[Array, " R"]:
        return np.array([((part[row] - part[other]) ** 2).sum() for part in self._parts])

    def _by_region(self, row: int) -> Float[Array, "R N"]:
        return np.stack([((part - part[row]) ** 2).sum(axis=1) for part in self._parts])


def _unit_spread(
    name: str, geometries: Float[Array, "N n 2"], members: Int[Array, " k"], least: float
) -> tuple[Float[Array, "N d"], float]:
    """A subregion's points over their spread, and that spread, px; at least the least one."""
    if not len(members):
        raise InputError(f"subregion {name}", "at least one point", "none")
    part = geometries[:, members].reshape(len(geometries), -1)
    part = (part - part.mean(axis=0)) / np.sqrt(len(members))
    spread = max(float(np.sqrt((part**2).sum(axis=1).mean())), least)
    scaled: Array = part / spread if spread > 0 else part
    return scaled, spread or 1.0
