"""Selection of examples: sharp frontal frames, by farthest point sampling of their geometries."""

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
"""Radians of yaw or pitch away from neutral, from which on parts of the face are hidden."""

_MIN_SHARPNESS = 0.5
"""Of the median sharpness; frames below are blurred."""


@dataclass(frozen=True)
class ExampleCandidates:
    """Photos or frames of one person that may become examples.

    Attributes:
        geometries: (N, n, 2) feature points, head motion compensated, px of the neutral photo.
        sharpness: (N,) any measure that grows with it.
        pose: (N, 2) yaw and pitch, radians.
        names: of the pictures, for reasons; "candidate 12" where there are none.
        rejections: reasons, known beforehand, why pictures cannot be examples; "" where they can.

    Raises:
        InputError: shapes, NaN.
    """

    geometries: Float[Array, "N n 2"]
    sharpness: Float[Array, " N"]
    pose: Float[Array, "N 2"]
    names: tuple[str, ...] = ()
    rejections: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that all parts are of the same photos."""
        count = len(check_array("geometries", self.geometries, (None, None, 2)))
        check_array("sharpness", self.sharpness, (count,))
        check_array("pose", self.pose, (count, 2))
        for name in ("names", "rejections"):
            texts = getattr(self, name)
            if texts and len(texts) != count:
                raise InputError(name, f"one for each of {count} candidates", len(texts))

    def all_rejections(self, neutral: int) -> list[str]:
        """The reason why each cannot be an example, also by pose and sharpness; "" where it can.

        Args:
            neutral: row of the face at rest.
        """
        turned = np.abs(self.pose - self.pose[neutral]).max(axis=1)
        median = float(np.median(self.sharpness))
        # Where most pictures have nothing sharp in them, none is rejected for it.
        relative = self.sharpness / median if median > 0 else np.ones(len(self.sharpness))
        known = self.rejections or ("",) * len(self.geometries)
        return [
            reason
            or (f"turned away by {np.degrees(turn):.0f} degrees" if turn > MAX_TURN else "")
            or (f"blurred, {sharp:.0%} of the usual sharpness" * bool(sharp < _MIN_SHARPNESS))
            for turn, sharp, reason in zip(turned, relative, known, strict=True)
        ]

    def name(self, row: int) -> str:
        """Name of a candidate, for reasons."""
        return self.names[row] if self.names else f"candidate {row}"


@dataclass(frozen=True)
class ExampleChoice:
    """The photos chosen, and why.

    Attributes:
        rows: (m,) of the candidates: neutral, the other required ones, then the most different
            first.
        reasons: one of each candidate, chosen or not.
        eligible: (N,) whether a candidate might have been chosen: neither blurred nor turned away
            nor rejected nor excluded.
    """

    rows: Int[Array, " m"]
    reasons: tuple[str, ...]
    eligible: Bool[Array, " N"]


def choose_examples(
    candidates: ExampleCandidates,
    regions: Sequence[tuple[str, Int[Array, " k"]]],
    neutral: int,
    *,
    count: int = COUNT,
    min_distance: float = 0.0,
    required: dict[int, str] | None = None,
    exclude: Sequence[int] = (),
) -> ExampleChoice:
    """Neutral, then again and again the photo that is farthest from those chosen so far.

    Distances are by subregion, each in units of its own spread: brows, which move by little, count
    as much as the mouth.

    Args:
        candidates: to choose from.
        regions: name of each subregion and the indices of its points.
        neutral: the row of the face at rest, chosen whatever its picture is like.
        count: of examples at most; fewer when all others are rejected or are like a chosen one. The
            paper has 10 to 15.
        min_distance: px, root mean square over the points of a subregion; a photo that differs from
            a chosen one by less in every subregion is like it.
        required: rows that are chosen in any case, with the reason.
        exclude: rows that are not.

    Raises:
        InputError: no such row, count not positive, a region without points.

    Source:
        [Zhang 2006] section 14, "sufficiently different from each other while covering all".
    """
    total = len(candidates.geometries)
    required = {neutral: "neutral"} | (required or {})
    _check_rows(total, neutral, required, exclude)
    if count < 1:
        raise InputError("count", "a number above zero", count)
    reasons = candidates.all_rejections(neutral)
    for row in exclude:
        reasons[row] = "excluded"
    eligible = np.array([not reason for reason in reasons])
    for row, reason in required.items():
        reasons[row] = reason
    usable = eligible.copy()
    usable[list(required)] = False
    distances = _Distances(candidates.geometries, regions, min_distance)
    rows = _farthest_point_sampling(distances, usable, candidates, reasons, list(required), count)
    return ExampleChoice(np.array(rows), tuple(reasons), eligible)


def _check_rows(total: int, neutral: int, required: dict[int, str], exclude: Sequence[int]) -> None:
    for name, rows in (("neutral", [neutral]), ("required", [*required]), ("exclude", exclude)):
        for row in rows:
            if not 0 <= row < total:
                raise InputError(name, f"one of {total} candidates, from 0", row)
    for row in exclude:
        if row in required:
            raise InputError("exclude", "others than those that are wanted", required[row])


def _farthest_point_sampling(
    distances: _Distances,
    usable: Bool[Array, " N"],
    candidates: ExampleCandidates,
    reasons: list[str],
    chosen: list[int],
    count: int,
) -> list[int]:
    """Add to `chosen` until there are enough; fills in `reasons`."""
    smallest, nearest = distances.to(chosen[0]), np.full(len(usable), chosen[0])

    def add(row: int) -> None:
        nonlocal smallest, nearest
        to_row = distances.to(row)
        nearest = np.where(to_row < smallest, row, nearest)
        smallest = np.minimum(to_row, smallest)

    for row in chosen[1:]:
        add(row)
    while len(chosen) < count and usable.any():
        row = int(np.where(usable, smallest, -1.0).argmax())
        other = int(nearest[row])
        usable[row] = False
        if not distances.differ(row, other):
            reasons[row] = f"like {candidates.name(other)}"
            continue
        chosen.append(row)
        reasons[row] = f"chosen as number {len(chosen)}, for the {distances.largest(row, other)}"
        add(row)
    for row in np.flatnonzero(usable).tolist():
        other = int(nearest[row])
        kind = (
            "different, but beyond the count; nearest is"
            if distances.differ(row, other)
            else "like"
        )
        reasons[row] = f"{kind} {candidates.name(other)}"
    return chosen


class _Distances:
    """Squared distances between candidates, summed over subregions.

    Args:
        geometries: (N, n, 2) px.
        regions: name and indices of points of each.
        min_distance: px by which two candidates differ at least.
    """

    def __init__(
        self,
        geometries: Float[Array, "N n 2"],
        regions: Sequence[tuple[str, Int[Array, " k"]]],
        min_distance: float,
    ) -> None:
        self._names = [name for name, _ in regions]
        parts = [_unit_spread(name, geometries, members, min_distance) for name, members in regions]
        self._parts = [part for part, _ in parts]
        self._min_distances = [min_distance / spread for _, spread in parts]

    def to(self, row: int) -> Float[Array, " N"]:
        """From every candidate to one."""
        return np.stack([((part - part[row]) ** 2).sum(axis=1) for part in self._parts]).sum(axis=0)

    def largest(self, row: int, other: int) -> str:
        """The subregion in which both differ most."""
        return self._names[int(self._between(row, other).argmax())].replace("_", " ")

    def differ(self, row: int, other: int) -> bool:
        """Whether they do in any subregion by more than the least distance."""
        distances = np.sqrt(self._between(row, other))
        return bool((distances > np.maximum(self._min_distances, 1e-9)).any())

    def _between(self, row: int, other: int) -> Float[Array, " R"]:
        return np.array([((part[row] - part[other]) ** 2).sum() for part in self._parts])


def _unit_spread(
    name: str, geometries: Float[Array, "N n 2"], members: Int[Array, " k"], min_spread: float
) -> tuple[Float[Array, "N d"], float]:
    """A subregion's points over their spread; that spread, px, `min_spread` at least."""
    if not len(members):
        raise InputError(f"subregion {name}", "at least one point", "none")
    part = geometries[:, members].reshape(len(geometries), -1)
    part = (part - part.mean(axis=0)) / np.sqrt(len(members))
    spread = max(float(np.sqrt((part**2).sum(axis=1).mean())), min_spread)
    scaled: Array = part / spread if spread > 0 else part
    return scaled, spread or 1.0
