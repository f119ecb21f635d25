"""Photos or a video of a person, as photos with landmarks and annotations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.capture.annotations import AnnotationNames, Annotations, load_annotations
from mien.capture.faces.detector import NO_FACE_FOUND, LandmarkDetector, NoFaceError
from mien.capture.faces.landmarks import Landmarks
from mien.capture.faces.mediapipe_face import yaw_pitch
from mien.capture.folder import (
    ANNOTATIONS,
    ignored_files,
    orphaned_annotations,
    photo_files,
)
from mien.capture.images.photos import DEFAULT_MAX_SIDE, Photo, load_photo
from mien.capture.notes import merge_notes
from mien.capture.source_kind import kind_of_source
from mien.capture.video.picked_frames import pick_frames
from mien.errors import EstimationError
from mien.progress import StepProgress
from mien.reading.names import portable_name

NO_FACE_YET = "no face found; the other photos tell where it was taken from, if they can"
"""Noted of a photo without a detected face: a profile, perhaps, or nobody."""

_ONE_VIEWPOINT_DEG = 10.0
_THUMBNAIL_SIDE = 32
_SAME_BRIGHTNESS = 1.0
_SAME_LANDMARKS = 0.02


@dataclass(frozen=True)
class CapturedView:
    """One photo of the person, with the landmarks and annotations of the face.

    Attributes:
        photo: the picture.
        landmarks: the detector's, or None where it finds no face (a profile, say).
        annotations: drawn by hand, which replace landmarks, or None.
    """

    photo: Photo
    landmarks: Landmarks | None
    annotations: Annotations | None

    @property
    def marked(self) -> bool:
        """Whether the photo has landmarks or annotations."""
        return self.landmarks is not None or self.annotations is not None


@dataclass(frozen=True)
class Capture:
    """All photos of one person.

    Attributes:
        name: of the source, without an ending.
        expressions: views by expression, never empty, `neutral` first where there is one; a source
            without expression folders holds `neutral` alone.
        notes: on what was left out, adapted or is odd; each names its file.
    """

    name: str
    expressions: dict[str, tuple[CapturedView, ...]]
    notes: tuple[str, ...] = ()

    @property
    def views(self) -> tuple[CapturedView, ...]:
        """Every view of every expression, in order."""
        return tuple(view for views in self.expressions.values() for view in views)


def load_capture(
    source: str | Path,
    *,
    max_side: int = DEFAULT_MAX_SIDE,
    face: int | None = None,
    frames: int = 7,
    expressions: int | None = None,
    names: AnnotationNames | None = None,
    progress: StepProgress | None = None,
) -> Capture:
    """The photos of a folder, of expression folders, or of a video, with landmarks and annotations.

    A photo in which no face is found stays if others of its expression show one: they may give its
    camera. Any other photo without a usable face and without annotations is left out. There is a
    note on each.

    Args:
        source: a folder of photos, a folder of one folder an expression, a photo or a video.
        max_side: larger photos are reduced to this many px on the longer side.
        face: which face to take where there are several, from left to right from 1; None takes the
            largest.
        frames: how many frames of a video to use at most for the face at rest.
        expressions: how many other expressions of a video at most; None takes those that differ.
        names: what annotations may name; None takes the generic head's names.
        progress: called after every photo or frame.

    Raises:
        InputError: there is nothing at `source`, or no photo in it.
        FileFormatError: a photo, a video or an annotation file is damaged.
        EstimationError: no photo shows a face.
    """
    kind, source = kind_of_source(source), Path(source)
    with LandmarkDetector() as detector:
        reader = _Reader(detector, max_side, face, names, progress)
        if kind == "video":
            found = reader.from_video(source, frames, expressions)
        else:
            found = reader.from_photos(source)
    found = {name: views for name, views in found.items() if views}
    if not found:
        reasons = [f"{photo}: {note}" for photo, note in reader.picture_notes if "left out" in note]
        raise EstimationError(
            f"{source}: no photo shows a face that can be used ({'; '.join(reasons[:3])})"
        )
    notes = (*reader.notes, *merge_notes(reader.picture_notes), *_viewpoint_notes(found))
    name = portable_name(source.with_suffix("") if source.is_file() else source.resolve())
    return Capture(name, found, notes)


class _Reader:
    """The options and the notes of one call of `load_capture`."""

    def __init__(
        self,
        detector: LandmarkDetector,
        max_side: int,
        face: int | None,
        names: AnnotationNames | None,
        progress: StepProgress | None,
    ) -> None:
        self.detector, self.max_side, self.face = detector, max_side, face
        self.names, self.progress = names, progress
        self.notes: list[str] = []
        self.picture_notes: list[tuple[str, str]] = []

    def from_photos(self, source: Path) -> dict[str, tuple[CapturedView, ...]]:
        """Every photo of every expression, each with the annotations beside it."""
        files = photo_files(source)
        self.notes += ignored_files(source)
        total, done = sum(map(len, files.values())), 0
        expressions: dict[str, tuple[CapturedView, ...]] = {}
        for expression, paths in files.items():
            views: list[CapturedView] = []
            for path in paths:
                photo = load_photo(path, max_side=self.max_side)
                self._add(views, photo, self._annotations_of(path, photo))
                done += 1
                if self.progress is not None:
                    self.progress(done, total)
            self.notes += orphaned_annotations(paths)
            expressions[expression] = self._with_face(views)
        return expressions

    def from_video(
        self, source: Path, count: int, expressions: int | None
    ) -> dict[str, tuple[CapturedView, ...]]:
        """The selected frames by expression."""
        picked = pick_frames(
            source,
            count=count,
            expressions=expressions,
            detector=self.detector,
            max_side=self.max_side,
            progress=self.progress,
        )
        self.notes += [f"{portable_name(source)}: {note}" for note in picked.notes]
        found = {}
        for name, photos in picked.expressions.items():
            views: list[CapturedView] = []
            for photo in photos:
                self._add(views, photo, None)
            found[name] = self._with_face(views)
        return found

    def _add(
        self, views: list[CapturedView], photo: Photo, annotations: Annotations | None
    ) -> None:
        """Add the photo as a view, unless its face cannot be used or it is a duplicate."""
        notes = list(photo.notes)
        landmarks, usable = None, True
        try:
            landmarks = self.detector.detect(photo, face=self.face)
            notes += landmarks.notes
        except EstimationError as error:
            usable = annotations is not None or isinstance(error, NoFaceError)
            reason = str(error).removeprefix(f"{photo.name}: ")
            if annotations is not None:
                notes.append(f"{reason}; annotations only")
            elif not usable:
                notes.append(f"left out: {reason}")
        if annotations is not None:
            notes += annotations.notes
        if usable:
            view = CapturedView(photo, landmarks, annotations)
            duplicate = next((other for other in views if _is_same_photo(view, other)), None)
            if duplicate is None or annotations is not None:
                views.append(view)
            else:
                notes.append(f"left out: the same photo as {duplicate.photo.name}")
        self.picture_notes += [(photo.name, note) for note in notes]

    def _with_face(self, views: list[CapturedView]) -> tuple[CapturedView, ...]:
        """The views if any has landmarks or annotations, those without included; otherwise none."""
        has_face = any(view.marked for view in views)
        note = NO_FACE_YET if has_face else f"left out: {NO_FACE_FOUND}"
        self.picture_notes += [(view.photo.name, note) for view in views if not view.marked]
        return tuple(views) if has_face else ()

    def _annotations_of(self, path: Path, photo: Photo) -> Annotations | None:
        file = path.parent / ANNOTATIONS / f"{path.stem}.json"
        if not file.is_file():
            return None
        return load_annotations(file, photo, names=self.names or _generic_names()) or None


@cache
def _generic_names() -> AnnotationNames:
    return AnnotationNames.of(load_generic_head())


def _viewpoint_notes(expressions: dict[str, tuple[CapturedView, ...]]) -> list[str]:
    """A note where several photos show the head from one side only."""
    notes = []
    for name, views in expressions.items():
        poses = [yaw_pitch(view.landmarks.R_cam_head) for view in views if view.landmarks]
        if len(poses) < 2 or len(poses) < len(views):
            continue
        span = np.degrees(np.ptp(poses, axis=0))
        if span.max() < _ONE_VIEWPOINT_DEG:
            notes.append(
                f"{name}: its {len(views)} photos look from nearly one side (yaw spans "
                f"{span[0]:.0f} degrees, pitch {span[1]:.0f}): they say little about depth"
            )
    return notes


def _is_same_photo(one: CapturedView, other: CapturedView) -> bool:
    """Equal pixels, or a copy that was saved again or resized.

    Copies differ by some tenths of a grey level in the mean of a 32x32 thumbnail, and in their
    landmarks by 1 % of the distance between the eyes, the repeatability of the detector.
    """
    first, second = one.photo.pixels, other.photo.pixels
    if first.shape == second.shape and np.array_equal(first, second):
        return True
    if one.landmarks is None or other.landmarks is None:
        return False
    aspect = np.log(first.shape[0] * second.shape[1] / (first.shape[1] * second.shape[0]))
    if abs(aspect) > 0.01:
        return False
    difference = np.abs(_thumbnail(first) - _thumbnail(second)).mean()
    return bool(difference < _SAME_BRIGHTNESS) and _have_same_landmarks(
        one.landmarks, other.landmarks, first.shape[1] / second.shape[1]
    )


def _have_same_landmarks(one: Landmarks, other: Landmarks, factor: float) -> bool:
    """After scaling the second photo by `factor` to the first one's size."""
    moved = np.linalg.norm(one.points - factor * other.points, axis=1)
    return bool(np.median(moved) < _SAME_LANDMARKS * one.eye_distance_px)


def _thumbnail(pixels: UInt8[Array, "h w 3"]) -> Float[Array, "t t 3"]:
    import cv2

    size = (_THUMBNAIL_SIDE, _THUMBNAIL_SIDE)
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.float64)
