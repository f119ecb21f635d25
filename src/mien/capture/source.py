"""Whatever a user has of a person, as photos with landmarks and annotations."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from mien.capture.annotations import AnnotationNames, Annotations, load_annotations
from mien.capture.detector import LandmarkDetector
from mien.capture.landmarks import Landmarks
from mien.capture.photos import MAX_SIDE, PHOTO_SUFFIXES, Photo, load_photo
from mien.errors import EstimationError, InputError

Progress = Callable[[int, int], None]
"""Called with the number of steps done and their total."""

NEUTRAL = "neutral"
ANNOTATIONS = "annotations"


@dataclass(frozen=True)
class View:
    """One photo of the person and what is known of the face in it.

    Attributes:
        photo: the picture.
        landmarks: the detector's, or None where it finds no face (a profile, say).
        annotations: hand-made marks, which win over landmarks, or None.
    """

    photo: Photo
    landmarks: Landmarks | None
    annotations: Annotations | None


@dataclass(frozen=True)
class Capture:
    """All photos of one person.

    Attributes:
        name: of the source, without an ending.
        expressions: views by expression, never empty; a source without expression folders holds
            the one expression `neutral`.
        notes: what was left out, adapted or looks odd; each names its file.
    """

    name: str
    expressions: dict[str, tuple[View, ...]]
    notes: tuple[str, ...] = ()

    @property
    def views(self) -> tuple[View, ...]:
        """Every view of every expression, in order."""
        return tuple(view for views in self.expressions.values() for view in views)


def load_capture(
    source: str | Path,
    *,
    max_side: int = MAX_SIDE,
    face: int | None = None,
    names: AnnotationNames | None = None,
    progress: Progress | None = None,
) -> Capture:
    """A folder of photos, a folder of expression folders, or one photo, with all that is known.

    Args:
        source: a folder of photos, a folder of one folder an expression, or a photo.
        max_side: larger photos are reduced to this many px on the longer side.
        face: which face to take where there are several, from left to right from 1; None takes
            the largest.
        names: what annotations may name; None takes the generic head's names.
        progress: told after every photo.
    Raises:
        InputError: there is nothing at `source`, or no photo in it.
        FileFormatError: a photo or an annotation file is damaged.
        EstimationError: no photo shows a face.
    """
    source = Path(source)
    folders = _expression_files(source)
    notes = _ignored_files(source)
    total, done = sum(map(len, folders.values())), 0
    expressions: dict[str, tuple[View, ...]] = {}
    with LandmarkDetector() as detector:
        for expression, paths in folders.items():
            views: list[View] = []
            for path in paths:
                view, said = _load_view(path, detector, max_side, face, names)
                notes += [f"{path.name}: {note}" for note in said]
                if view is not None:
                    views.append(view)
                done += 1
                if progress is not None:
                    progress(done, total)
            if views:
                expressions[expression] = tuple(views)
    if not expressions:
        raise EstimationError(f"{source}: none of its photos shows a face that can be used")
    return Capture(
        source.stem if source.is_file() else source.resolve().name, expressions, tuple(notes)
    )


def _load_view(
    path: Path,
    detector: LandmarkDetector,
    max_side: int,
    face: int | None,
    names: AnnotationNames | None,
) -> tuple[View | None, list[str]]:
    """The view, or None when neither detector nor annotations tell where the face is."""
    photo = load_photo(path, max_side=max_side)
    notes = list(photo.notes)
    annotations = _annotations_beside(path, photo, names)
    try:
        landmarks = detector.detect(photo, face=face)
    except EstimationError as error:
        reason = str(error).removeprefix(f"{photo.name}: ")
        if annotations is None:
            return None, [*notes, f"left out: {reason}"]
        landmarks = None
        notes.append(f"{reason}; its annotations alone are used")
    notes += landmarks.notes if landmarks else ()
    notes += annotations.notes if annotations else ()
    return View(photo, landmarks, annotations), notes


def _annotations_beside(
    path: Path, photo: Photo, names: AnnotationNames | None
) -> Annotations | None:
    file = path.parent / ANNOTATIONS / f"{path.stem}.json"
    if not file.is_file():
        return None
    return load_annotations(file, photo, names=names or _generic_names()) or None


@cache
def _generic_names() -> AnnotationNames:
    from mien.assets.generic import load_generic_head

    return AnnotationNames.of(load_generic_head())


def _expression_files(source: Path) -> dict[str, list[Path]]:
    """Photos by expression, `neutral` first, each in natural order."""
    if source.is_file():
        return {NEUTRAL: [source]}
    if not source.is_dir():
        raise InputError(source, "a photo, a video or a folder of photos", "nothing there")
    photos = _photos_in(source)
    if photos:
        return {NEUTRAL: photos}
    folders = {folder.name: _photos_in(folder) for folder in _subfolders(source)}
    folders = {name: paths for name, paths in folders.items() if paths}
    if not folders:
        raise InputError(source, "photos in this folder or in folders within", "none")
    return dict(sorted(folders.items(), key=lambda item: item[0].lower() != NEUTRAL))


def _ignored_files(source: Path) -> list[str]:
    """A note on files that are no photos; hidden ones need none."""
    if not source.is_dir():
        return []
    folders = [source] if _photos_in(source) else [source, *_subfolders(source)]
    ignored = [
        str(path.relative_to(source))
        for folder in folders
        for path in _listed(folder)
        if path.is_file() and not _is_photo(path)
    ]
    if not ignored:
        return []
    shown = ", ".join(ignored[:5]) + (", ..." if len(ignored) > 5 else "")
    return [f"{len(ignored)} files that are no photos were ignored: {shown}"]


def _photos_in(folder: Path) -> list[Path]:
    return [path for path in _listed(folder) if path.is_file() and _is_photo(path)]


def _subfolders(folder: Path) -> list[Path]:
    return [path for path in _listed(folder) if path.is_dir() and path.name != ANNOTATIONS]


def _is_photo(path: Path) -> bool:
    return path.suffix.lower() in PHOTO_SUFFIXES


def _listed(folder: Path) -> list[Path]:
    """What is not hidden, in natural order: photo_2 before photo_10."""
    try:
        paths = [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError as error:
        raise InputError(folder, "a readable folder", error.strerror or error) from None
    return sorted(paths, key=lambda path: natural_key(path.name))


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """A sorting key in which digits count as numbers."""
    parts = re.split(r"(\d+)", name.lower())
    return [(0, int(part)) if part.isdigit() else (1, part) for part in parts if part]
