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
from mien.capture.notes import merge_notes
from mien.capture.source_kind import SourceKind, kind_of_source
from mien.io.examples.example_folder import (
    check_example_place,
    is_example_folder,
    write_example_files,
)
from mien.io.files.atomic import atomic_folder
from mien.io.files.image import encode_image
from mien.io.files.manifest import kept_notes
from mien.pipelines.example_annotations import (
    AnnotatedPoints,
    annotation_files,
    annotation_notes,
    apply_all_annotations,
    apply_annotations,
    load_annotated_points,
)
from mien.progress import Progress, StepProgress, no_progress
from mien.reading.names import portable_name
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
DETECTING_AGAIN, WRITING = "Looking at them again", "Writing"
COUNTED = (FINDING,)
"""Stages whose steps are pictures."""
EXAMPLE_SIDE = 1200
"""px; larger photos are reduced to it: a face needs no more than some 600 px for its wrinkles."""


@dataclass(frozen=True)
class ExampleRequest:
    """The user's options; pictures by frame number or file name.

    Attributes:
        count: of examples at most.
        neutral: the picture of the face at rest; None: found.
        standard: the picture in which subregions are drawn; None: found.
        include: pictures that are examples in any case; of a video, stretches of frames as well,
            as `860-930`.
        exclude: likewise, pictures that are not used.
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
    max_side: int = EXAMPLE_SIDE
    even: bool = True

    def overrides(self, series: FaceSeries) -> SelectionOverrides:
        """The same by the rows of a series.

        Raises:
            InputError: names what is not there.
        """
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
    """The examples of a source.

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


def save_example_folder(
    source: str | Path,
    folder: str | Path,
    *,
    request: ExampleRequest | None = None,
    progress: Progress | None = None,
) -> GatheredExamples:
    """Examples of a person, in a folder, whole or not at all.

    Args:
        source: as for `gather_examples`.
        folder: to write; one that holds examples is replaced.
        request: as for `gather_examples`.
        progress: as for `gather_examples`.

    Raises:
        InputError: before anything is written; as `gather_examples`, a source that mien made, and a
            place that holds something else.
        FileFormatError: as InputError.
        EstimationError: as InputError.
    """
    report = progress or no_progress
    kind = kind_of_source(source)
    check_example_place(folder, read=[source])
    gathered = _gather(source, kind, request, None, report)
    report(WRITING, 0, 0)
    with atomic_folder(folder, replaces=is_example_folder, read=[source], editable=()) as temporary:
        write_example_files(temporary, gathered.examples, why=gathered.why)
        sheet = example_sheet(gathered.examples, gathered.why)
        (temporary / "examples.jpg").write_bytes(encode_image(sheet, "JPEG", quality=92))
        (temporary / "choice.csv").write_text(_choice_csv(gathered.pictures), encoding="utf-8")
    report(WRITING, 1, 1)
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
        source: the video or the folder.
        request: the user's options.
        layout: of the points; mien's own unless given.
        progress: called with the stage, steps done and their total.

    Raises:
        InputError: no such source, a picture asked for that is not there.
        FileFormatError: a damaged photo, video or file of annotations.
        EstimationError: no picture shows a face.
    """
    report = progress or no_progress
    return _gather(source, kind_of_source(source), request, layout, report)


def _gather(
    source: str | Path,
    kind: SourceKind,
    request: ExampleRequest | None,
    layout: FeatureLayout | None,
    report: Progress,
) -> GatheredExamples:
    request, layout = request or ExampleRequest(), layout or load_feature_layout()
    measured = _Measurements(layout)
    with LandmarkDetector() as detector:
        series = find_faces(
            source,
            detector,
            max_side=request.max_side,
            kind=kind,
            face=request.face,
            on_picture=measured,
            progress=partial(report, FINDING),
        )
    overrides = request.overrides(series)
    annotated = _annotated_points(series, layout)
    points = apply_all_annotations(layout, np.stack(measured.points), annotated)
    plan = plan_examples(
        layout,
        series,
        points,
        overrides=overrides,
        rejections=rejection_reasons(points, series.sizes, measured.lips.occluded(series.seconds)),
        count=request.count,
    )
    photos = dict(load_pictures(series, plan.choice.rows.tolist(), partial(report, FETCHING)))
    plan = plan.with_points(
        _averaged(series, layout, photos, annotated, partial(report, DETECTING_AGAIN))
    )
    video = portable_name(series.source) if series.is_video else ""
    examples, why = build_examples(plan, photos, source=video, equalize=request.even)
    pictures = dict(zip(plan.names, plan.choice.reasons, strict=True)) | series.left_out
    notes = _notes(series, layout, plan, annotated, photos, examples)
    return GatheredExamples(examples, why, tuple(sorted(pictures.items())), notes)


class _Measurements:
    """Taken from each picture while its pixels are in memory."""

    def __init__(self, layout: FeatureLayout) -> None:
        self.lips = LipContrast(layout)
        self.points: list[Array] = []
        self._layout = layout

    def __call__(self, pixels: UInt8[Array, "h w 3"], landmarks: Float[Array, "478 2"]) -> None:
        self.lips(pixels, landmarks)
        self.points.append(detected_points(self._layout, pixels, landmarks))


def _annotated_points(series: FaceSeries, layout: FeatureLayout) -> dict[int, AnnotatedPoints]:
    """Hand-made annotations, by row, where there are any."""
    annotated: dict[int, AnnotatedPoints] = {}
    for row, file in enumerate(series.files):
        if annotation_files(file):
            photo = load_photo(file, max_side=series.max_side)
            annotated[row] = load_annotated_points(file, photo, layout)
    return {row: points for row, points in annotated.items() if points}


def _averaged(
    series: FaceSeries,
    layout: FeatureLayout,
    photos: Mapping[int, Photo],
    annotated: Mapping[int, AnnotatedPoints],
    report: StepProgress,
) -> dict[int, Float[Array, "n 2"]]:
    """The examples' points averaged over several detections, by row; annotated ones stay."""
    averaged = {}
    with LandmarkDetector() as detector:
        for number, (row, photo) in enumerate(photos.items()):
            points = averaged_points(layout, detector, photo.pixels, series.landmarks[row])
            averaged[row] = apply_annotations(layout, points, annotated.get(row, {}))
            report(number + 1, len(photos))
    return averaged


def _notes(
    series: FaceSeries,
    layout: FeatureLayout,
    plan: ExamplePlan,
    annotated: Mapping[int, AnnotatedPoints],
    photos: Mapping[int, Photo],
    examples: ExampleSet,
) -> tuple[str, ...]:
    """What was odd in the pictures, how many were what, and what was changed or is missing."""
    notes = [*series.notes]
    notes += [note for file in series.files for note in annotation_notes(file, layout)]
    notes += merge_notes(
        (series.names[row], f"{len(points)} points marked by hand")
        for row, points in annotated.items()
    )
    counts = Counter(_kind(reason) for reason in plan.choice.reasons)
    counts[NO_FACE] = len(series.left_out)
    kinds = [
        f"{counts[kind]} {kind}" for kind in ("chosen", *KINDS.values(), NO_FACE) if counts[kind]
    ]
    notes.append(f"of {len(series) + len(series.left_out)} pictures {', '.join(kinds)}")
    pairs = list(zip(examples.examples, plan.choice.rows.tolist(), strict=True))
    changed = sum(example.photo is not photos[row].pixels for example, row in pairs)
    if changed:
        notes.append(f"exposure of {changed} examples brought to that of the face at rest")
    if len(pairs) == 1:
        notes.append("one example alone shows no expression but its own")
    return tuple(notes)


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
"""Kinds of pictures that are not chosen, by the beginning of their reasons."""


def _kind(reason: str) -> str:
    return next((kind for start, kind in KINDS.items() if reason.startswith(start)), "chosen")


def _choice_csv(pictures: Sequence[tuple[str, str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["picture", "reason"])
    writer.writerows(pictures)
    return stream.getvalue()
