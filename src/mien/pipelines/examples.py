"""`mien examples`: photos or a video of one person to what expressions are mixed from."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.face_series import FaceSeries, find_faces, load_pictures, row_of, rows_of
from mien.capture.images.photos import Photo, load_photo
from mien.capture.notes import gathered_notes
from mien.capture.source_kind import kind_of_source
from mien.io.examples.example_folder import (
    check_example_place,
    is_example_folder,
    write_example_files,
)
from mien.io.files.atomic import atomic_folder
from mien.io.files.image import encode_image
from mien.io.files.manifest import kept_notes
from mien.pipelines.example_annotations import (
    Marks,
    annotation_files,
    annotation_notes,
    apply_all_annotations,
    apply_annotations,
    read_annotated_points,
)
from mien.progress import Progress, StepProgress, no_progress
from mien.reading.names import plain_name
from mien.report.example_sheet import example_sheet
from mien.synthesis.examples.brow_correction import detected_points
from mien.synthesis.examples.example_plan import (
    ExamplePlan,
    SelectionOverrides,
    build_examples,
    plan_examples,
)
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.landmark_averaging import averaged_points
from mien.synthesis.examples.mouth_occlusion import LipContrast
from mien.synthesis.examples.quality_filter import CUT, OCCLUDED, rejection_reasons
from mien.synthesis.examples.selection import COUNT

FINDING, FETCHING = "Finding the face", "Fetching the examples"
LOOKING, WRITING = "Looking at them again", "Writing"
COUNTED = (FINDING,)
"""Stages whose steps are pictures."""
MAX_SIDE = 1200
"""px; larger photos are reduced to it: a face needs no more than some 600 px for its wrinkles."""


@dataclass(frozen=True)
class ExampleRequest:
    """What the user says of the choice; pictures by frame number or file name.

    Attributes:
        count: of examples at most.
        neutral: which picture is that; None: found.
        standard: which picture is that; None: found.
        include: pictures that are, and are not, to be examples; of a video, stretches of frames as
            well, as `860-930`.
        exclude: as `include`.
        face: which one, from left to right, in photos of several people.
        max_side: px; larger pictures are reduced to it.
        even: bring photos to one exposure.
    """

    count: int = COUNT
    neutral: str | None = None
    standard: str | None = None
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    face: int | None = None
    max_side: int = MAX_SIDE
    even: bool = True

    def overrides(self, series: FaceSeries) -> SelectionOverrides:
        """The same by the rows of a series. Raises: InputError: names what is not there."""
        return SelectionOverrides(
            None if self.neutral is None else row_of(series, self.neutral, "--neutral"),
            None if self.standard is None else row_of(series, self.standard, "--standard"),
            _all_rows(series, self.include, "--include"),
            _all_rows(series, self.exclude, "--exclude"),
        )


def _all_rows(series: FaceSeries, names: Sequence[str], option: str) -> tuple[int, ...]:
    return tuple(dict.fromkeys(row for name in names for row in rows_of(series, name, option)))


@dataclass(frozen=True)
class GatheredExamples:
    """What came of a source.

    Attributes:
        examples: in the order in which they were chosen, neutral first.
        why: each was chosen, by name.
        pictures: name and reason, or "", of all that there were.
        notes: what the user should know.
    """

    examples: ExampleSet
    why: dict[str, str]
    pictures: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


def write_example_folder(
    source: str | Path,
    folder: str | Path,
    *,
    request: ExampleRequest | None = None,
    progress: Progress | None = None,
) -> GatheredExamples:
    """Examples of a person, in a folder, whole or not at all.

    Raises:
        InputError: before anything is written; as `gather_examples`, a source that mien made, and a
            place that holds something else.
        FileFormatError: as InputError.
        EstimationError: as InputError.
    """
    tell = progress or no_progress
    kind_of_source(source)
    check_example_place(folder, read=[source])
    gathered = gather_examples(source, request=request, progress=tell)
    tell(WRITING, 0, 0)
    with atomic_folder(folder, replaces=is_example_folder, read=[source], stay=()) as temporary:
        write_example_files(temporary, gathered.examples, why=gathered.why)
        sheet = example_sheet(gathered.examples, gathered.why)
        (temporary / "examples.jpg").write_bytes(encode_image(sheet, "JPEG", quality=92))
        (temporary / "choice.csv").write_text(_choice_csv(gathered.pictures), encoding="utf-8")
    tell(WRITING, 1, 1)
    return replace(gathered, notes=(*gathered.notes, *kept_notes(Path(folder))))


def gather_examples(
    source: str | Path,
    *,
    request: ExampleRequest | None = None,
    layout: FeatureLayout | None = None,
    progress: Progress | None = None,
) -> GatheredExamples:
    """Examples of the person in a video or in a folder of photos.

    Args:
        layout: of the points; mien's own unless given.
        progress: told the stage, steps done and their total.

    Raises:
        InputError: no such source, a picture asked for that is not there.
        FileFormatError: a damaged photo, video or file of marks.
        EstimationError: no picture shows a face.
    """
    request, layout = request or ExampleRequest(), layout or load_feature_layout()
    tell = progress or no_progress
    looked = _Looked(layout)
    with LandmarkDetector() as detector:
        series = find_faces(
            source,
            detector,
            max_side=request.max_side,
            face=request.face,
            look=looked,
            report=partial(tell, FINDING),
        )
    overrides = request.overrides(series)
    marks = _marks(series, layout)
    points = apply_all_annotations(layout, np.stack(looked.points), marks)
    rejections = rejection_reasons(points, series.sizes, looked.lips.occluded(series.seconds))
    plan = plan_examples(
        layout, series, points, overrides=overrides, rejections=rejections, count=request.count
    )
    rows = plan.choice.rows.tolist()
    photos = dict(load_pictures(series, rows, partial(tell, FETCHING)))
    plan = plan.with_points(_steady(series, layout, photos, marks, partial(tell, LOOKING)))
    video = plain_name(series.source) if series.is_video else ""
    examples, why = build_examples(plan, photos, source=video, equalize=request.even)
    pictures = dict(zip(plan.names, plan.choice.reasons, strict=True)) | series.left_out
    unused = [note for file in series.files for note in annotation_notes(file, layout)]
    notes = [
        *series.notes,
        *unused,
        *_notes(plan, series, marks),
        *_set_notes(examples, photos, rows),
    ]
    return GatheredExamples(examples, why, tuple(sorted(pictures.items())), tuple(notes))


def _steady(
    series: FaceSeries,
    layout: FeatureLayout,
    photos: Mapping[int, Photo],
    marks: Mapping[int, Marks],
    report: StepProgress,
) -> dict[int, Float[Array, "n 2"]]:
    """The examples' points from several looks at each, by row; marks win."""
    found = {}
    with LandmarkDetector() as detector:
        for number, (row, photo) in enumerate(photos.items()):
            points = averaged_points(layout, detector, photo.pixels, series.landmarks[row])
            found[row] = apply_annotations(layout, points, marks.get(row, {}))
            report(number + 1, len(photos))
    return found


class _Looked:
    """What is taken from each picture as long as its pixels are there."""

    def __init__(self, layout: FeatureLayout) -> None:
        self.lips = LipContrast(layout)
        self.points: list[Array] = []
        self._layout = layout

    def __call__(self, pixels: UInt8[Array, "h w 3"], landmarks: Float[Array, "478 2"]) -> None:
        self.lips(pixels, landmarks)
        self.points.append(detected_points(self._layout, pixels, landmarks))


def _marks(series: FaceSeries, layout: FeatureLayout) -> dict[int, Marks]:
    """Hand-made marks, by row, where there are any."""
    found: dict[int, Marks] = {}
    for row, file in enumerate(series.files):
        if annotation_files(file):
            found[row] = read_annotated_points(
                file, load_photo(file, max_side=series.max_side), layout
            )
    return {row: marks for row, marks in found.items() if marks}


def _notes(plan: ExamplePlan, series: FaceSeries, marks: dict[int, Marks]) -> list[str]:
    """How many pictures were what, and what is missing."""
    notes = gathered_notes(
        (series.names[row], f"{len(found)} points marked by hand") for row, found in marks.items()
    )
    counts = Counter(_kind(reason) for reason in plan.choice.reasons)
    counts[NO_FACE] = len(series.left_out)
    kinds = ("chosen", *KINDS.values(), NO_FACE)
    told = [f"{counts[kind]} {kind}" for kind in kinds if counts[kind]]
    notes.append(f"of {len(series) + len(series.left_out)} pictures {', '.join(told)}")
    return notes


def _set_notes(examples: ExampleSet, photos: Mapping[int, Photo], rows: Sequence[int]) -> list[str]:
    """What was done to the examples' photos, and what they cannot do."""
    pairs = zip(examples.examples, rows, strict=True)
    changed = sum(example.photo is not photos[row].pixels for example, row in pairs)
    notes = []
    if changed:
        notes.append(f"exposure of {changed} examples brought to that of the face at rest")
    if len(rows) == 1:
        notes.append("one example alone shows no expression but its own")
    return notes


NO_FACE = "without a usable face"
KINDS = {
    "like ": "like chosen ones",
    "different": "different, but beyond the count",
    "blurred": "blurred",
    "turned away": "turned away",
    CUT: "cut by the picture's edge",
    OCCLUDED: "with something before the mouth",
    "small": "small",
    "excluded": "excluded",
}
"""What pictures that are not chosen are called, by how their reasons begin."""


def _kind(reason: str) -> str:
    return next((kind for start, kind in KINDS.items() if reason.startswith(start)), "chosen")


def _choice_csv(pictures: Sequence[tuple[str, str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["picture", "reason"])
    writer.writerows(pictures)
    return stream.getvalue()
