"""Whatever a user has of a person, as photos with landmarks and annotations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from mien.capture.annotations import AnnotationNames, Annotations, load_annotations
from mien.capture.duplicates import same_photo
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
from mien.capture.notes import gathered_notes
from mien.capture.source_kind import kind_of_source
from mien.capture.video.picked_frames import pick_frames
from mien.errors import EstimationError
from mien.progress import StepProgress
from mien.reading.names import portable_name

TO_BE_PLACED = "no face found; the other photos tell where it was taken from, if they can"
"""Noted of a photo that shows a profile, perhaps, or nobody."""

_ONE_VIEWPOINT = 10.0


@dataclass(frozen=True)
class CapturedView:
    """One photo of the person and what is known of the face in it.

    Attributes:
        photo: the picture.
        landmarks: the detector's, or None where it finds no face (a profile, say).
        annotations: hand-made marks, which win over landmarks, or None.
    """

    photo: Photo
    landmarks: Landmarks | None
    annotations: Annotations | None

    @property
    def marked(self) -> bool:
        """Whether it is known of any point where the photo shows it."""
        return self.landmarks is not None or self.annotations is not None


@dataclass(frozen=True)
class Capture:
    """All photos of one person.

    Attributes:
        name: of the source, without an ending.
        expressions: views by expression, never empty, `neutral` first where there is one; a source
            without expression folders holds `neutral` alone.
        notes: what was left out, adapted or looks odd; each names its file.
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
    """Photos from a folder, expression folders, one photo or a video, with all that is known.

    A photo in which no face is found stays if others of its expression show one, for they may tell
    where it was taken from. Any other photo without a usable face and without annotations is left
    out. Notes tell of both.

    Args:
        source: a folder of photos, a folder of one folder an expression, a photo or a video.
        max_side: larger photos are reduced to this many px on the longer side.
        face: which face to take where there are several, from left to right from 1; None takes the
            largest.
        frames: how many frames of a video to use at most for the face at rest.
        expressions: how many other expressions of a video at most; None takes those that differ.
        names: what annotations may name; None takes the generic head's names.
        progress: told after every photo or frame.

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
        reasons = [f"{photo}: {note}" for photo, note in reader.told if "left out" in note]
        raise EstimationError(
            f"{source}: no photo shows a face that can be used ({'; '.join(reasons[:3])})"
        )
    notes = (*reader.notes, *gathered_notes(reader.told), *_viewpoint_notes(found))
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
        self.told: list[tuple[str, str]] = []

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
            expressions[expression] = self._settled(views)
        return expressions

    def from_video(
        self, source: Path, count: int, expressions: int | None
    ) -> dict[str, tuple[CapturedView, ...]]:
        """The chosen frames by expression."""
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
            found[name] = self._settled(views)
        return found

    def _add(
        self, views: list[CapturedView], photo: Photo, annotations: Annotations | None
    ) -> None:
        """The photo as another view, unless its face is of no use or it is there already."""
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
            twin = next((other for other in views if same_photo(view, other)), None)
            if twin is None or annotations is not None:
                views.append(view)
            else:
                notes.append(f"left out: the same photo as {twin.photo.name}")
        self.told += [(photo.name, note) for note in notes]

    def _settled(self, views: list[CapturedView]) -> tuple[CapturedView, ...]:
        """Photos without a face stay if any other photo of the expression has one."""
        anchored = any(view.marked for view in views)
        what = TO_BE_PLACED if anchored else f"left out: {NO_FACE_FOUND}"
        self.told += [(view.photo.name, what) for view in views if not view.marked]
        return tuple(views) if anchored else ()

    def _annotations_of(self, path: Path, photo: Photo) -> Annotations | None:
        file = path.parent / ANNOTATIONS / f"{path.stem}.json"
        if not file.is_file():
            return None
        return load_annotations(file, photo, names=self.names or _generic_names()) or None


@cache
def _generic_names() -> AnnotationNames:
    from mien.assets.generic import load_generic_head

    return AnnotationNames.of(load_generic_head())


def _viewpoint_notes(expressions: dict[str, tuple[CapturedView, ...]]) -> list[str]:
    """A note where several photos show the head from one side only."""
    notes = []
    for name, views in expressions.items():
        poses = [yaw_pitch(view.landmarks.R_cam_head) for view in views if view.landmarks]
        if len(poses) < 2 or len(poses) < len(views):
            continue
        span = np.degrees(np.ptp(poses, axis=0))
        if span.max() < _ONE_VIEWPOINT:
            notes.append(
                f"{name}: its {len(views)} photos look from nearly one side (yaw spans "
                f"{span[0]:.0f} degrees, pitch {span[1]:.0f}): they say little about depth"
            )
    return notes
