"""From pictures of a person, and where their points are, to a set of examples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import PurePosixPath

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.feature_points import FeatureLayout
from mien.assets.subregions import default_subregions
from mien.capture.faces.face_series import FaceSeries
from mien.capture.folder import NEUTRAL
from mien.capture.images.photos import Photo
from mien.capture.video.frame_selection import FrameScores, choose_frames
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.examples.exposure import equalize_exposure
from mien.synthesis.examples.head_alignment import align_to_neutral
from mien.synthesis.examples.selection import (
    COUNT,
    DETECTOR_NOISE,
    ExampleCandidates,
    ExampleChoice,
    choose_examples,
)

__all__ = ["ExamplePlan", "SelectionOverrides", "build_examples", "lip_gaps", "plan_examples"]

ASKED_FOR = "as asked for"
MIN_DIFFERENCE = 3.0
"""Two examples differ in some subregion by so many times the detector's noise. On three quiet clips
held-out pictures are as near with 3 as without any such limit (18, 40 and 19 examples instead of
33, 40 and 30, within 0.15 dB); 5 costs up to 0.8 dB, 8 up to 2.3."""
MAX_STATISTICS = 2000
"""More sound pictures than these are thinned out evenly: their covariance stays the same."""
TEETH_GAP = 0.03
"""Gap of the lips, in widths of the face, from which on teeth can be seen between them."""


@dataclass(frozen=True)
class SelectionOverrides:
    """What the user wants otherwise; rows of the series.

    Attributes:
        neutral: the face at rest.
        standard: whose picture subregions are drawn in.
        include: examples whatever they are like.
        exclude: pictures not to be used at all.
    """

    neutral: int | None = None
    standard: int | None = None
    include: tuple[int, ...] = ()
    exclude: tuple[int, ...] = ()


@dataclass(frozen=True)
class ExamplePlan:
    """Which pictures are to be what.

    Attributes:
        layout: of the points.
        points: (N, n, 2) px of each picture.
        geometries: (N, n, 2) the same without head motion, px of the neutral picture.
        choice: rows of the examples, neutral first; a reason for every picture.
        standard: its place among these.
        names: of all pictures.
    """

    layout: FeatureLayout
    points: Float[Array, "N n 2"]
    geometries: Float[Array, "N n 2"]
    choice: ExampleChoice
    standard: int
    names: tuple[str, ...]

    @property
    def statistics(self) -> Float[Array, "S n 2"]:
        """Geometries of the sound pictures and of the examples."""
        used = self.choice.sound.copy()
        used[self.choice.rows] = True
        rows = np.flatnonzero(used)
        thin = np.unique(np.rint(np.linspace(0, len(rows) - 1, MAX_STATISTICS)).astype(int))
        return self.geometries[rows[thin] if len(rows) > MAX_STATISTICS else rows]

    def with_points(self, points: Mapping[int, Float[Array, "n 2"]]) -> ExamplePlan:
        """The same with better points in some pictures, the examples' among them.

        What points of these were off by in the mean, those of all others are taken to be off by.

        Args:
            points: by row, px of the picture.
        """
        rows, better = list(points), self.points.copy()
        better[rows] = list(points.values())
        neutral = better[self.choice.rows[0]]
        geometries, _ = align_to_neutral(better, neutral)
        before, _ = align_to_neutral(self.points[rows], neutral)
        others = np.setdiff1d(np.arange(len(better)), rows)
        geometries[others] += (geometries[rows] - before).mean(axis=0)
        return replace(self, points=better, geometries=geometries)


def plan_examples(
    layout: FeatureLayout,
    series: FaceSeries,
    points: Float[Array, "N n 2"],
    *,
    wishes: SelectionOverrides | None = None,
    unfit: Sequence[str] = (),
    count: int = COUNT,
    different: float = MIN_DIFFERENCE,
) -> ExamplePlan:
    """The face at rest, the one with the mouth most open, and those that differ most.

    Args:
        points: feature points in each of the series' pictures, px.
        unfit: why a picture cannot be an example, "" where it can; none: all can.
        count: of examples at most.
        different: times the detector's noise that an example must differ by from all others.

    Raises:
        InputError: as choose_examples.
    """
    wishes = wishes or SelectionOverrides()
    neutral = _at_rest(series, unfit, wishes)
    geometries, _ = align_to_neutral(points, points[neutral])
    candidates = ExampleCandidates(
        geometries, series.scores.sharpness, series.scores.pose, series.names, tuple(unfit)
    )
    standard, reason = _standard(layout, candidates, neutral, wishes)
    wanted = {neutral: "neutral"} | {standard: reason}
    wanted |= {row: ASKED_FOR for row in wishes.include if row not in wanted}
    # Members of subregions do not depend on the picture.
    regions = default_subregions(layout, points[neutral], (1, 1))
    choice = choose_examples(
        candidates,
        list(zip(regions.names, regions.members, strict=True)),
        neutral,
        count=count,
        least=different * DETECTOR_NOISE * _width(points[neutral]),
        wanted=wanted,
        exclude=wishes.exclude,
    )
    place = int(np.flatnonzero(choice.rows == standard)[0])
    return ExamplePlan(layout, points, geometries, choice, place, series.names)


def build_examples(
    plan: ExamplePlan, photos: Mapping[int, Photo], *, source: str = "", even: bool = True
) -> tuple[ExampleSet, dict[str, str]]:
    """The examples of a plan, and why each was chosen, by its name.

    Args:
        photos: by row, those of the choice.
        source: of the pictures, where their names alone do not tell: the video's name.
        even: bring them to one exposure, neutral's.
    """
    names = _short_names([plan.names[row] for row in plan.choice.rows])
    rows = plan.choice.rows.tolist()
    examples = tuple(
        Example(name, photos[row].pixels, plan.points[row], _source(plan.names[row], source))
        for name, row in zip(names, rows, strict=True)
    )
    if even:
        examples = equalize_exposure(plan.layout, examples)
    standard = examples[plan.standard]
    height, width = standard.photo.shape[:2]
    gaps = lip_gaps(plan.layout, plan.geometries[rows]) / _width(examples[0].points)
    built = ExampleSet(
        plan.layout,
        examples,
        plan.standard,
        plan.statistics,
        default_subregions(plan.layout, standard.points, (width, height)),
        tuple(np.flatnonzero(gaps >= TEETH_GAP).tolist()),
    )
    return built, {name: plan.choice.reasons[row] for name, row in zip(names, rows, strict=True)}


def lip_gaps(layout: FeatureLayout, points: Float[Array, "N n 2"]) -> Float[Array, " N"]:
    """How far the lips are apart in their middle, in the unit of the points."""
    upper, lower = (layout.index(f"{which}_lip_inner") for which in ("upper", "lower"))
    return np.linalg.norm(points[:, lower] - points[:, upper], axis=1)


def _at_rest(series: FaceSeries, unfit: Sequence[str], wishes: SelectionOverrides) -> int:
    """The row of the face at rest: in a folder of that name, if there is one."""
    if wishes.neutral is not None:
        return wishes.neutral
    names = [name if name.startswith(f"{NEUTRAL}/") else "" for name in series.names]
    rows = np.flatnonzero(names) if any(names) else np.arange(len(series))
    fit = [r for r in rows.tolist() if r not in wishes.exclude and not (unfit and unfit[r])]
    chosen = np.array(fit) if fit else rows
    return int(chosen[choose_frames(_only(series.scores, chosen), 1)[0]])


def _only(scores: FrameScores, rows: Int[Array, " m"]) -> FrameScores:
    return FrameScores(*(getattr(scores, field.name)[rows] for field in fields(scores)))


def _standard(
    layout: FeatureLayout, candidates: ExampleCandidates, neutral: int, wishes: SelectionOverrides
) -> tuple[int, str]:
    """The row of the standard image and why it is that."""
    if wishes.standard is not None:
        both = wishes.standard == neutral
        return wishes.standard, "neutral and standard" if both else f"standard, {ASKED_FOR}"
    reasons = candidates.left_out(neutral)
    sound = [r for r, reason in enumerate(reasons) if not reason and r not in wishes.exclude]
    rows = np.array(sound or [neutral])
    widest = int(rows[lip_gaps(layout, candidates.geometries[rows]).argmax()])
    reason = "neutral and standard" if widest == neutral else "standard, its mouth is most open"
    return widest, reason


def _width(points: Float[Array, "n 2"]) -> float:
    """Of the face, px."""
    return float(np.ptp(points[:, 0]))


def _short_names(names: Sequence[str]) -> list[str]:
    """File names without endings, unless two would be the same."""
    stems = [str(PurePosixPath(name).with_suffix("")).replace("/", "-") for name in names]
    count = Counter(stems)
    whole = [name.replace("/", "-") for name in names]
    return [stem if count[stem] == 1 else name for stem, name in zip(stems, whole, strict=True)]


def _source(name: str, source: str) -> str:
    return f"{source}, {PurePosixPath(name).stem.replace('_', ' ')}" if source else name
