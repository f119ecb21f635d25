"""What `mien synthesize` is asked to draw: points of a file, or those of a photo's face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.faces.landmarks import inside_picture
from mien.capture.images.photos import load_photo
from mien.errors import EstimationError, InputError
from mien.io.files.atomic import check_file_place, check_files_apart
from mien.io.files.image import image_kind
from mien.io.landmarks.points_file import load_feature_points
from mien.numeric.planar_similarity import PlanarMotion
from mien.pipelines.example_annotations import (
    annotation_files,
    annotation_notes,
    apply_annotations,
    read_annotated_points,
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

__all__ = ["HeadChoice", "Target", "check_request", "target_from_photo", "target_from_points"]

HeadChoice = Literal["auto", "still", "moved"]

_FAR = 0.5
"""Face widths beyond the edge of the picture from which points are of another picture."""

_LARGER = 1.5
"""A face so much larger than in the neutral photo is visibly soft."""


@dataclass(frozen=True)
class Target:
    """What is to be drawn.

    Attributes:
        points: (n, 2) px of the picture.
        motion: of the head, from the neutral photo to the picture; None: none.
        size: width and height of the picture; None: the neutral photo's.
        notes: what the user should know.
    """

    points: Float[Array, "n 2"]
    motion: PlanarMotion | None = None
    size: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()


def check_request(
    folder: str | Path,
    points: str | Path | None,
    photo: str | Path | None,
    *written: str | Path | None,
) -> None:
    """Refuse what cannot be done before the work is.

    Args:
        folder: the examples or the head.
        points: files, of which one is given.
        photo: files, of which one is given.
        written: files that are to be written; the first is the picture.

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
) -> Target:
    """All points from those of a file, px of the neutral photo.

    Args:
        path: as for `load_feature_points`.
        head: whether it is where the neutral photo has it, or moved: then the points tell how, and
            the picture moves with it. Of both, "auto" takes what makes the points likelier.

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
        return Target(points, notes=notes)
    if head == "auto":
        notes = (
            *notes,
            f"{path}: the head moved, and so does the picture (--head still: it did not)",
        )
    return Target(points, synthesizer.head_motion(points), notes=notes)


def target_from_photo(synthesizer: Synthesizer, path: str | Path, *, face: int | None) -> Target:
    """The points of a photo's face; marks beside the photo win, as for `mien examples`.

    Those outside of the photo follow from the others, where enough is known of the person.

    Args:
        face: which one, from left to right from 1; None: the largest.

    Raises:
        InputError: no photo, or a damaged one; no such face.
        FileFormatError: no photo, or a damaged one; no such face.
        EstimationError: no face in it, or one too small.
    """
    from mien.capture.faces.detector import LandmarkDetector

    layout = synthesizer.examples.layout
    photo = load_photo(path)
    with LandmarkDetector() as detector:
        landmarks = detector.detect(photo, face=face)
        # As the examples' points are found: see there.
        detected = averaged_points(layout, detector, photo.pixels, landmarks.points)
    points = apply_annotations(layout, detected, read_annotated_points(Path(path), photo, layout))
    points = _guessed_outside(synthesizer, points, photo.size)
    motion = synthesizer.head_motion(points)
    notes = [f"{path}: {note}" for note in (*photo.notes, *landmarks.notes)]
    notes += [*annotation_notes(Path(path), layout), *_stranger_notes(synthesizer, path, points)]
    if motion.scale > _LARGER:
        times = f"{float(motion.scale):.1f} times as large as in the examples"
        notes.append(f"{path}: the face is {times}: the picture is as soft as they are")
    return Target(points, motion, photo.size, tuple(notes))


def _guessed_outside(
    synthesizer: Synthesizer, points: Float[Array, "n 2"], size: tuple[int, int]
) -> Float[Array, "n 2"]:
    """Points beyond the edge of a picture from those inside, where enough is known of the person:

    10 to 20 % nearer than the detector's guess where the edge cuts more than the chin (cap13).
    """
    known = np.flatnonzero(inside_picture(points, size))
    enough = len(synthesizer.examples.statistics) >= MIN_STATISTICS
    if not enough or not MIN_MOTION_POINTS <= len(known) < len(points):
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
    """That some points lie outside of the picture. Raises: InputError: far outside."""
    layout, neutral = synthesizer.examples.layout, synthesizer.examples.neutral
    height, width = neutral.photo.shape[:2]
    beyond = _beyond(positions, (width, height))
    worst = int(beyond.argmax())
    if beyond[worst] > _FAR * face_width(layout, neutral.points):
        expected = f"px of the neutral photo, which is {width}x{height}"
        place = ", ".join(f"{number:g}" for number in positions[worst])
        raise InputError(path, expected, f"{layout.names[known[worst]]} at {place}")
    told = _told_outside(layout.names, known, beyond)
    return (f"{path}: {told}",) if told else ()


def _beyond(points: Float[Array, "k 2"], size: tuple[int, int]) -> Float[Array, " k"]:
    """How far points lie outside of a picture, px; below 0 inside."""
    return np.maximum(-points, points - size).max(axis=1)


def _told_outside(
    names: Sequence[str], known: Int[Array, " k"], beyond: Float[Array, " k"]
) -> str | None:
    count = int((beyond > 0).sum())
    farthest = names[known[int(beyond.argmax())]]
    told = f"{count} of {len(known)} points lie outside of the picture, {farthest} farthest"
    return told if count else None


def _stranger_notes(
    synthesizer: Synthesizer, path: str | Path, points: Float[Array, "n 2"]
) -> list[str]:
    odd = mahalanobis_rms(synthesizer.examples, points)
    if odd is None or odd < OUTLIER_RMS:
        return []
    return [
        f"{path}: the face looks like another person's, or is turned far: its shape is "
        f"{odd / OUTLIER_RMS:.1f} times as far as usual from all that was seen of this person; "
        "its points are taken as they are"
    ]
