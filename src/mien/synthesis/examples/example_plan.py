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
from mien.capture.images.photos import Photo
from mien.capture.video.frame_selection import FrameScores, choose_frames
from mien.head import NEUTRAL
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

AS_ASKED = "as asked for"
MIN_DIFFERENCE = 3.0
"""Two examples differ in some subregion by so many times the detector's noise. On three quiet clips
held-out pictures are as near with 3 as without any such limit (18, 40 and 19 examples instead of
33, 40 and 30, within 0.15 dB); 5 costs up to 0.8 dB, 8 up to 2.3."""
MAX_STATISTICS = 2000
"""Of more pictures, evenly spaced ones are used: their covariance stays the same."""
TEETH_GAP = 0.03
"""Gap of the lips, in widths of the face, from which on teeth are visible."""


@dataclass(frozen=True)
class SelectionOverrides:
    """The user's choices; rows of the series.

    Attributes:
        neutral: the face at rest.
        standard: in whose picture subregions are drawn.
        include: examples in any case.
        exclude: pictures not to be used at all.
    """

    neutral: int | None = None
    standard: int | None = None
    include: tuple[int, ...] = ()
    exclude: tuple[int, ...] = ()


@dataclass(frozen=True)
class ExamplePlan:
    """Which pictures become which examples.

    Attributes:
        layout: of the points.
        points: (N, n, 2) px of each picture.
        geometries: (N, n, 2) the same, head motion compensated, px of the neutral picture.
        choice: rows of the examples, neutral first; a reason for every picture.
        standard: index of the standard image among these rows.
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
        """Geometries of the eligible pictures and of the examples."""
        used = self.choice.eligible.copy()
        used[self.choice.rows] = True
        rows = np.flatnonzero(used)
        spaced = np.unique(np.rint(np.linspace(0, len(rows) - 1, MAX_STATISTICS)).astype(int))
        return self.geometries[rows[spaced] if len(rows) > MAX_STATISTICS else rows]

    def with_points(self, points: Mapping[int, Float[Array, "n 2"]]) -> ExamplePlan:
        """The same with more accurate points in some pictures, the examples' among them.

        Their mean correction is applied to the geometries of all other pictures.

        Args:
            points: by row, px of the picture.
        """
        rows, accurate = list(points), self.points.copy()
        accurate[rows] = list(points.values())
        neutral = accurate[self.choice.rows[0]]
        geometries, _ = align_to_neutral(accurate, neutral)
        before, _ = align_to_neutral(self.points[rows], neutral)
        others = np.setdiff1d(np.arange(len(accurate)), rows)
        geometries[others] += (geometries[rows] - before).mean(axis=0)
        return replace(self, points=accurate, geometries=geometries)


def plan_examples(
    layout: FeatureLayout,
    series: FaceSeries,
    points: Float[Array, "N n 2"],
    *,
    overrides: SelectionOverrides | None = None,
    rejections: Sequence[str] = (),
    count: int = COUNT,
) -> ExamplePlan:
    """The face at rest, the one with the mouth most open, and those that differ most.

    Args:
        layout: of the points.
        series: the pictures.
        points: feature points in each of the series' pictures, px.
        overrides: the user's choices.
        rejections: why each picture cannot be an example, "" where it can; () if all can.
        count: of examples at most.

    Raises:
        InputError: as choose_examples.
    """
    overrides = overrides or SelectionOverrides()
    neutral = _neutral_row(series, rejections, overrides)
    geometries, _ = align_to_neutral(points, points[neutral])
    candidates = ExampleCandidates(
        geometries, series.scores.sharpness, series.scores.pose, series.names, tuple(rejections)
    )
    standard, reason = _standard_row(layout, candidates, neutral, overrides)
    required = {neutral: "neutral"} | {standard: reason}
    required |= {row: AS_ASKED for row in overrides.include if row not in required}
    # Members of subregions do not depend on the picture.
    regions = default_subregions(layout, points[neutral], (1, 1))
    choice = choose_examples(
        candidates,
        list(zip(regions.names, regions.members, strict=True)),
        neutral,
        count=count,
        min_distance=MIN_DIFFERENCE * DETECTOR_NOISE * _width(points[neutral]),
        required=required,
        exclude=overrides.exclude,
    )
    index = int(np.flatnonzero(choice.rows == standard)[0])
    return ExamplePlan(layout, points, geometries, choice, index, series.names)


def build_examples(
    plan: ExamplePlan, photos: Mapping[int, Photo], *, source: str = "", equalize: bool = True
) -> tuple[ExampleSet, dict[str, str]]:
    """The examples of a plan, and why each was chosen, by its name.

    Args:
        plan: which pictures they are.
        photos: by row, those of the choice.
        source: name of the video; "" for photos, whose own names suffice.
        equalize: bring them to one exposure, neutral's.
    """
    names = _short_names([plan.names[row] for row in plan.choice.rows])
    rows = plan.choice.rows.tolist()
    examples = tuple(
        Example(name, photos[row].pixels, plan.points[row], _source(plan.names[row], source))
        for name, row in zip(names, rows, strict=True)
    )
    if equalize:
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
    """Distance of the lips in their middle, in the unit of the points.

    Args:
        layout: of the points.
        points: (N, n, 2).
    """
    upper, lower = (layout.index(f"{which}_lip_inner") for which in ("upper", "lower"))
    return np.linalg.norm(points[:, lower] - points[:, upper], axis=1)


def _neutral_row(
    series: FaceSeries, rejections: Sequence[str], overrides: SelectionOverrides
) -> int:
    """The row of the face at rest: in a folder of that name, if there is one."""
    if overrides.neutral is not None:
        return overrides.neutral
    in_folder = np.array([name.startswith(f"{NEUTRAL}/") for name in series.names])
    rows = np.flatnonzero(in_folder) if in_folder.any() else np.arange(len(series))
    rejected = {row for row, reason in enumerate(rejections) if reason} | {*overrides.exclude}
    usable = np.array([row for row in rows.tolist() if row not in rejected] or rows)
    return int(usable[choose_frames(_scores_of(series.scores, usable), 1)[0]])


def _scores_of(scores: FrameScores, rows: Int[Array, " m"]) -> FrameScores:
    return FrameScores(*(getattr(scores, field.name)[rows] for field in fields(scores)))


def _standard_row(
    layout: FeatureLayout,
    candidates: ExampleCandidates,
    neutral: int,
    overrides: SelectionOverrides,
) -> tuple[int, str]:
    """The row of the standard image, and the reason."""
    if overrides.standard is not None:
        both = overrides.standard == neutral
        return overrides.standard, "neutral and standard" if both else f"standard, {AS_ASKED}"
    reasons = candidates.all_rejections(neutral)
    usable = [r for r, reason in enumerate(reasons) if not reason and r not in overrides.exclude]
    rows = np.array(usable or [neutral])
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


def _source(name: str, video: str) -> str:
    return f"{video}, {PurePosixPath(name).stem.replace('_', ' ')}" if video else name
