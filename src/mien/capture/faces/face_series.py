"""Every picture of one person's face: all photos of a folder, or all frames of a video."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int, UInt8
from mien.capture.faces.detector import LandmarkDetector, refine_small_face
from mien.capture.faces.frame_faces import FrameFaces
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.capture.faces.sharpness import face_sharpness
from mien.capture.folder import ignored_files, orphaned_annotations, photo_files
from mien.capture.images.photos import Photo, load_photo
from mien.capture.notes import merge_notes
from mien.capture.source_kind import SourceKind, kind_of_source
from mien.capture.video.clip_notes import ClipNotes
from mien.capture.video.frame_photos import fetch_frames, frame_name
from mien.capture.video.frame_selection import FrameScores
from mien.capture.video.frames_ahead import frames_ahead
from mien.capture.video.orientation import turn_upright
from mien.capture.video.video import Video
from mien.errors import EstimationError, InputError
from mien.progress import StepProgress
from mien.reading.names import portable_name

__all__ = ["FaceSeries", "PictureCallback", "find_faces", "load_pictures", "row_of", "rows_of"]

PictureCallback = Callable[[UInt8[Array, "h w 3"], Float[Array, "478 2"]], None]
"""Called with the pixels and landmarks of each picture that shows a face, in the series' order."""


@dataclass(frozen=True)
class FaceSeries:
    """The pictures that show the person's face, without their pixels.

    Attributes:
        source: the video or the folder.
        is_video: whether it is a video.
        files: of a folder, each picture's file; of a video, empty.
        names: of the pictures: `frame_000123.png`, `smile.jpg`, or `joy/smile.jpg` in a folder of
            one folder an expression.
        landmarks: (N, 478, 2) float32, px of the picture as `load_pictures` gives it.
        sizes: (N, 2) their widths and heights, px.
        scores: of the same; `index` counts frames or photos from 0.
        seconds: of a video's frames, since its beginning.
        max_side: px; larger pictures are reduced to it.
        quarters: turns counterclockwise of a video's frames, beyond those that its file states.
        left_out: the reason by name for every picture in which no face can be used.
        notes: what was clip_notes.
    """

    source: Path
    is_video: bool
    files: tuple[Path, ...]
    names: tuple[str, ...]
    landmarks: Float[Array, "n 478 2"]
    sizes: Int[Array, "n 2"]
    scores: FrameScores
    seconds: Float[Array, " n"] | None
    max_side: int
    left_out: dict[str, str]
    notes: tuple[str, ...]
    quarters: int = 0

    def __len__(self) -> int:
        """How many pictures show the face."""
        return len(self.names)


def find_faces(
    source: str | Path,
    detector: LandmarkDetector,
    *,
    max_side: int,
    kind: SourceKind | None = None,
    face: int | None = None,
    on_picture: PictureCallback | None = None,
    progress: StepProgress | None = None,
) -> FaceSeries:
    """The face in every photo of a folder or in every frame of a video.

    Args:
        source: a video, a folder or a photo.
        detector: finds the faces.
        max_side: px; larger pictures are reduced to it.
        kind: of the source, if it is known already.
        face: as for LandmarkDetector.detect, of photos; a video's is the largest.
        on_picture: called with each picture that shows the face, while its pixels are in memory.
        progress: called after every picture.

    Raises:
        InputError: no such source, no photo in it; a `face` of a video.
        FileFormatError: a damaged picture or video.
        EstimationError: no picture shows a face.
    """
    kind, source = kind or kind_of_source(source), Path(source)
    builder = _SeriesBuilder(source, max_side, on_picture or (lambda pixels, landmarks: None))
    if kind == "video":
        if face is not None:
            raise InputError("--face", "photos to choose a face in", f"a video, {source.name}")
        builder.read_video(detector, progress)
    else:
        builder.read_photos(detector, face, progress)
    return builder.series()


def load_pictures(
    series: FaceSeries, rows: Collection[int], progress: StepProgress | None = None
) -> Iterator[tuple[int, Photo]]:
    """The pictures of some rows of a series with the rows, in the series' order."""
    if not series.is_video:
        for number, row in enumerate(sorted(rows)):
            yield row, load_photo(series.files[row], max_side=series.max_side)
            if progress is not None:
                progress(number + 1, len(rows))
        return
    by_frame = {int(series.scores.index[row]): row for row in rows}
    last = max(by_frame, default=0)
    for index, photo in fetch_frames(
        Video(series.source, series.quarters),
        by_frame,
        series.max_side,
        lambda frame: None if progress is None else progress(frame + 1, last + 1),
    ):
        yield by_frame[index], photo


class _SeriesBuilder:
    """The pictures and faces found so far."""

    def __init__(self, source: Path, max_side: int, on_picture: PictureCallback) -> None:
        self.source, self.max_side, self.on_picture = source, max_side, on_picture
        self.is_video = False
        self.files: list[Path] = []
        self.names: list[str] = []
        self.sizes: list[tuple[int, int]] = []
        self.seconds: list[float] = []
        self.rows: list[tuple[int, float, DetectedFace]] = []
        self.left_out: dict[str, str] = {}
        self.notes: list[str] = []
        self.picture_notes: list[tuple[str, str]] = []
        self.quarters = 0

    def read_video(self, detector: LandmarkDetector, progress: StepProgress | None) -> None:
        """Every frame, in one pass."""
        self.is_video = True
        video = Video(self.source)
        turn_upright(video, detector)
        self.quarters = video.quarters
        total, clip_notes, finder = video.info().frames, ClipNotes(), FrameFaces(detector)
        with frames_ahead(video, max_side=self.max_side) as pictures:
            for picture in pictures:
                faces = finder.find(picture.pixels)
                clip_notes.add_frame(picture.pixels, faces)
                if not faces:
                    self.left_out[frame_name(picture.frame)] = "no face found"
                else:
                    found = refine_small_face(detector, picture.pixels, faces[0])
                    self.seconds.append(picture.seconds)
                    self._add(frame_name(picture.frame), picture.frame, picture.pixels, found)
                if progress is not None:
                    progress(picture.frame + 1, max(total, picture.frame + 1))
        name = portable_name(self.source)
        self.notes += [f"{name}: {note}" for note in (*video.notes, *clip_notes.notes)]

    def read_photos(
        self, detector: LandmarkDetector, face: int | None, progress: StepProgress | None
    ) -> None:
        """Every photo, by `LandmarkDetector.detect`."""
        folders = photo_files(self.source)
        self.notes += ignored_files(self.source)
        total = sum(map(len, folders.values()))
        number = 0
        for folder, paths in folders.items():
            self.notes += orphaned_annotations(paths)
            for path in paths:
                name = (
                    portable_name(path) if len(folders) == 1 else f"{folder}/{portable_name(path)}"
                )
                self._add_photo(name, number, path, detector, face)
                number += 1
                if progress is not None:
                    progress(number, total)

    def _add_photo(
        self, name: str, number: int, path: Path, detector: LandmarkDetector, face: int | None
    ) -> None:
        photo = load_photo(path, max_side=self.max_side)
        self.picture_notes += [(name, note) for note in photo.notes]
        try:
            landmarks = detector.detect(photo, face=face)
        except EstimationError as error:
            self.left_out[name] = str(error).removeprefix(f"{photo.name}: ")
            return
        self.picture_notes += [(name, note) for note in landmarks.notes]
        self.files.append(path)
        self._add(name, number, photo.pixels, landmarks.as_detected_face())

    def _add(
        self, name: str, number: int, pixels: UInt8[Array, "h w 3"], found: DetectedFace
    ) -> None:
        points = found.points[:, :2]
        self.names.append(name)
        self.sizes.append((pixels.shape[1], pixels.shape[0]))
        # A long video has many: single precision halves their memory.
        found = replace(found, points=found.points.astype(np.float32))
        self.rows.append((number, face_sharpness(pixels, points), found))
        self.on_picture(pixels, points)

    def series(self) -> FaceSeries:
        """The series. Raises: EstimationError: no picture shows a face."""
        if not self.rows:
            what = "frames" if self.is_video else "photos"
            reasons = [f"{name}: {reason}" for name, reason in self.left_out.items()]
            shown = "" if self.is_video else f" ({'; '.join(reasons[:3])})"
            raise EstimationError(f"{self.source}: no face found in any of its {what}{shown}")
        return FaceSeries(
            self.source,
            self.is_video,
            tuple(self.files),
            tuple(self.names),
            np.stack([found.points[:, :2] for _, _, found in self.rows]),
            np.array(self.sizes),
            FrameScores.of(*zip(*self.rows, strict=True)),
            np.array(self.seconds) if self.is_video else None,
            self.max_side,
            self.left_out,
            (*self.notes, *merge_notes(self.picture_notes)),
            self.quarters,
        )


def row_of(series: FaceSeries, what: str, option: str) -> int:
    """The row of a picture that a user names: a frame's number, a file's name, its stem.

    Args:
        series: the pictures.
        what: what the user names.
        option: the option that names it, for messages.

    Raises:
        InputError: there is none; several; one that shows no face.
    """
    if series.is_video and what.isascii() and what.isdecimal():
        what = frame_name(int(what))
    rows = [row for row, name in enumerate(series.names) if what in _names_of(name)]
    if len(rows) == 1:
        return rows[0]
    if rows:
        raise InputError(option, "one picture", f"{what!r}, which names {len(rows)}")
    for name, reason in series.left_out.items():
        if what in _names_of(name):
            raise InputError(option, "a picture that shows the face", f"{name}: {reason}")
    raise InputError(option, _expected(series), what)


def rows_of(series: FaceSeries, what: str, option: str) -> list[int]:
    """As row_of, and all frames of a range such as `860-930`.

    Args:
        series: the pictures.
        what: what the user names.
        option: the option that names it, for messages.

    Raises:
        InputError: as row_of; a range without a picture that shows the face.
    """
    span = re.fullmatch(r"(\d{1,9})-(\d{1,9})", what, re.ASCII)
    if not (series.is_video and span):
        return [row_of(series, what, option)]
    index = series.scores.index
    rows = np.flatnonzero((index >= int(span[1])) & (index <= int(span[2])))
    if not len(rows):
        raise InputError(option, "a stretch of frames that show the face", what)
    return rows.tolist()


def _names_of(name: str) -> tuple[str, ...]:
    path = Path(name)
    return (name, str(path.with_suffix("")), path.name, path.stem)


def _expected(series: FaceSeries) -> str:
    if series.is_video:
        last = int(series.scores.index[-1])
        return f"the number of a frame, from 0 to {last}, or its name"
    shown = ", ".join(series.names[:3]) + (", ..." if len(series) > 3 else "")
    return f"the name of a photo ({shown})"
