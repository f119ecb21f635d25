"""The target of `mien synthesize`: all points, from those of a file or of a photo's face."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.landmarks import inside_picture
from mien.capture.images.photos import load_photo
from mien.errors import EstimationError, InputError
from mien.io.files.atomic import check_file_place, check_files_apart
from mien.io.files.image import image_kind
from mien.io.landmarks.points_file import load_feature_points
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.pipelines.example_annotations import (
    annotation_files,
    annotation_notes,
    apply_annotations,
    load_annotated_points,
)
from mien.synthesis.examples.landmark_averaging import averaged_points
from mien.synthesis.inference.input_checks import (
    MIN_STATISTICS,
    OUTLIER_RMS,
    face_width,
    head_moved,
    look_mirrored,
    mahalanobis_rms,
)
from mien.synthesis.synthesizer import MIN_MOTION_POINTS, Synthesizer

__all__ = [
    "HeadChoice",
    "SynthesisTarget",
    "check_request",
    "target_from_photo",
    "target_from_points",
]

HeadChoice = Literal["auto", "still", "moved"]

_MAX_OUTSIDE = 0.5
"""Face widths beyond the edge of the picture from which points are of another picture."""

_SOFT_SCALE = 1.5
"""A face so many times as large as in the neutral photo is visibly soft."""


@dataclass(frozen=True)
class SynthesisTarget:
    """The picture to draw.

    Attributes:
        points: (n, 2) px of the picture.
        motion: of the head, from the neutral photo to the picture; None: none.
        size: width and height of the picture; None: the neutral photo's.
        notes: what the user should know.
    """

    points: Float[Array, "n 2"]
    motion: PlanarSimilarity | None = None
    size: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()


def check_request(
    folder: str | Path,
    points: str | Path | None,
    photo: str | Path | None,
    *written: str | Path | None,
) -> None:
    """Check the files before any work.

    Args:
        folder: the examples or the head.
        points: file of feature points, or
        photo: file of one.
        written: files to write; the first is the picture.

    Raises:
        InputError: neither or both, another kind of picture, a file over another one, a place that
            cannot be written.
    """
    if (points is None) == (photo is None):
        expected = "--points FILE or --photo FILE: where the expression's points are"
        raise InputError("mien synthesize", expected, "neither" if points is None else "both")
    places = [path for path in written if path is not None]
    image_kind(places[0])
    read = [Path(path) for path in (points, photo) if path is not None]
    check_files_apart(places, [folder, *read, *annotation_files(read[0])])
    for path in places:
        check_file_place(path)


def target_from_points(
    synthesizer: Synthesizer, path: str | Path, *, head: HeadChoice = "auto"
) -> SynthesisTarget:
    """All points from those of a file, px of the neutral photo.

    Args:
        synthesizer: of the person.
        path: as for `load_feature_points`.
        head: whether it is where the neutral photo has it, or moved: then its motion is estimated
            from the points, and the picture moves with it. "auto" takes the likelier of both.

    Raises:
        InputError: fewer than three points, points that look mirrored or lie far outside.
        FileFormatError: as `load_feature_points`.
        EstimationError: all points in one place.
    """
    layout = synthesizer.examples.layout
    known, positions = load_feature_points(path, layout)
    if len(known) < MIN_MOTION_POINTS:
        expected = f"at least {MIN_MOTION_POINTS} points of {layout.name}"
        raise InputError(path, expected, ", ".join(layout.names[index] for index in known))
    _check_sides(synthesizer, path, known, positions)
    notes = _outside_notes(synthesizer, path, known, positions)
    moved = head == "moved" or (
        head == "auto" and head_moved(synthesizer.examples, known, positions)
    )
    points = synthesizer.complete(known, positions, head="estimated" if moved else "still")
    if not moved:
        return SynthesisTarget(points, notes=notes)
    if head == "auto":
        notes = (
            *notes,
            f"{path}: the head moved, and so does the picture (--head still: it did not)",
        )
    return SynthesisTarget(points, synthesizer.head_motion(points), notes=notes)


def target_from_photo(
    synthesizer: Synthesizer, path: str | Path, *, face: int | None
) -> SynthesisTarget:
    """The points of a photo's face, or annotated ones beside it, as for `mien examples`.

    Those outside of the photo are inferred from the others, where the statistics of the person
    suffice.

    Args:
        synthesizer: of the person.
        path: of the photo.
        face: which one, from left to right from 1; None: the largest.

    Raises:
        InputError: no photo, or a damaged one; no such face.
        FileFormatError: no photo, or a damaged one; no such face.
        EstimationError: no face in it, or one too small.
    """
    layout = synthesizer.examples.layout
    photo = load_photo(path)
    with LandmarkDetector() as detector:
        landmarks = detector.detect(photo, face=face)
        # In the same way as the points of the examples: see there.
        detected = averaged_points(layout, detector, photo.pixels, landmarks.points)
    points = apply_annotations(layout, detected, load_annotated_points(Path(path), photo, layout))
    points = _complete_outside(synthesizer, points, photo.size)
    motion = synthesizer.head_motion(points)
    notes = [f"{path}: {note}" for note in (*photo.notes, *landmarks.notes)]
    notes += [*annotation_notes(Path(path), layout), *_outlier_notes(synthesizer, path, points)]
    if motion.scale > _SOFT_SCALE:
        times = f"{float(motion.scale):.1f} times as large as in the examples"
        notes.append(f"{path}: the face is {times}: the picture is as soft as they are")
    return SynthesisTarget(points, motion, photo.size, tuple(notes))


def _complete_outside(
    synthesizer: Synthesizer, points: Float[Array, "n 2"], size: tuple[int, int]
) -> Float[Array, "n 2"]:
    """Points with those beyond the edge of a picture inferred from those inside.

    They are 10 to 20 % nearer than detected ones where the edge cuts more than the chin (cap13).
    With few statistics the detected ones stay.
    """
    known = np.flatnonzero(inside_picture(points, size))
    few = len(synthesizer.examples.statistics) < MIN_STATISTICS
    if few or not MIN_MOTION_POINTS <= len(known) < len(points):
        return points
    return synthesizer.complete(known, points[known], head="estimated")


def _check_sides(
    synthesizer: Synthesizer, path: str | Path, known: Int[Array, " k"], positions: Array
) -> None:
    examples = synthesizer.examples
    try:
        mirrored = look_mirrored(examples.layout, examples.neutral.points, known, positions)
    except EstimationError as error:
        raise EstimationError(f"{path}: {error}") from None
    if mirrored:
        expected = "right and left as the subject has them"
        raise InputError(path, expected, "points that fit the face only when mirrored")


def _outside_notes(
    synthesizer: Synthesizer, path: str | Path, known: Int[Array, " k"], positions: Array
) -> tuple[str, ...]:
    """A note if some points lie outside of the picture.

    Raises:
        InputError: far outside.
    """
    layout, neutral = synthesizer.examples.layout, synthesizer.examples.neutral
    height, width = neutral.photo.shape[:2]
    # px outside of the picture; below 0 inside.
    outside = np.maximum(-positions, positions - [width, height]).max(axis=1)
    worst = int(outside.argmax())
    if outside[worst] > _MAX_OUTSIDE * face_width(layout, neutral.points):
        expected = f"px of the neutral photo, which is {width}x{height}"
        position = ", ".join(f"{number:g}" for number in positions[worst])
        raise InputError(path, expected, f"{layout.names[known[worst]]} at {position}")
    count = int((outside > 0).sum())
    if not count:
        return ()
    name = layout.names[known[worst]]
    return (f"{path}: {count} of {len(known)} points lie outside of the picture, {name} farthest",)


def _outlier_notes(
    synthesizer: Synthesizer, path: str | Path, points: Float[Array, "n 2"]
) -> list[str]:
    distance = mahalanobis_rms(synthesizer.examples, points)
    if distance is None or distance < OUTLIER_RMS:
        return []
    return [
        f"{path}: the face looks like another person's, or is turned far: its shape is "
        f"{distance / OUTLIER_RMS:.1f} times as far as usual from all that was seen of this "
        "person; its points are taken as they are"
    ]
