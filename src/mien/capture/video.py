"""Frames of a video, upright and in order."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.files import check_readable, kind_of, one_line
from mien.capture.photos import MAX_PIXELS
from mien.errors import FileFormatError

if TYPE_CHECKING:
    from av import VideoFrame
    from av.container import InputContainer
    from av.video.stream import VideoStream

VIDEO_SUFFIXES = frozenset((".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mts", ".3gp"))

_USUAL_RATE = 25
_PER_SECOND = 1e6  # FFmpeg's unit of a container's times
_PQ, _HLG = 16, 18


@dataclass(frozen=True)
class Frame:
    """One decoded picture, not yet converted.

    Attributes:
        index: from 0, in order of display.
        seconds: since the clip's beginning.
        stored_size: width and height of the clip's pictures before they are turned upright, px,
            their pixels made square.
        raw: as the decoder gave it; of another size where a clip changes it on its way.
    """

    index: int
    seconds: float
    stored_size: tuple[int, int]
    raw: VideoFrame

    @property
    def hdr(self) -> bool:
        """Coded for a brighter range than sRGB's, which shifts its colours here."""
        return self.raw.color_trc in (_PQ, _HLG)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its pixels, px."""
        width, height = self.stored_size
        return (height, width) if self._quarters % 2 else (width, height)

    def pixels(self, *, max_side: int | None = None) -> UInt8[Array, "h w 3"]:
        """(H, W, 3) sRGB with square pixels, the container's rotation flag applied.

        Args:
            max_side: px; a picture whose longer side is longer is reduced to it by averaging while
                its colours are converted, which takes less than doing one after the other.
        """
        factor = min(1.0, (max_side or np.inf) / max(self.stored_size))
        width, height = (max(1, round(side * factor)) for side in self.stored_size)
        # The scaler's quickest way, "FAST_BILINEAR", shifts pictures by most of a pixel.
        how = "AREA" if height < self.raw.height else "BILINEAR"
        stored = self.raw.to_ndarray(format="rgb24", width=width, height=height, interpolation=how)
        return np.ascontiguousarray(np.rot90(stored, self._quarters))

    @property
    def _quarters(self) -> int:
        """Turns to make it upright, counterclockwise as the flag and numpy count."""
        return round(self.raw.rotation / 90)


@dataclass(frozen=True)
class VideoFacts:
    """What a file states of its pictures, and its first one shows.

    Attributes:
        width, height: upright, px.
        fps: frames a second, their mean where it varies.
        frames: how many; 0: unknown.
        seconds: how long; None: unknown.
    """

    width: int
    height: int
    fps: float
    frames: int
    seconds: float | None


@dataclass
class Video:
    """A clip that is being read.

    Attributes:
        path: the file.
        notes: grows while frames are read: a stream that breaks, frames that cannot be decoded.
    """

    path: Path
    notes: list[str] = field(default_factory=list)

    def frames(self) -> Generator[Frame]:
        """Every frame in order of display. A stream that breaks half-way ends there, with a note.

        Raises: InputError, FileFormatError: not a video, no frames, too large.
        """
        import av

        count = 0
        with self._opened() as container:
            stream = self._stream(container)
            try:
                for frame in _decoded(container, stream):
                    if frame.hdr:
                        self._note("HDR video: its colours are approximate")
                    yield frame
                    count += 1
            except av.FFmpegError as error:
                reason = one_line(error.strerror or error)
                self._note(f"the stream breaks after {count} frames ({reason})")
            stated = _stated_frames(container, stream)
            if 0 < count < 0.95 * stated - 2:
                self._note(f"{count} of the {stated} frames that it states can be read")
        if not count:
            raise FileFormatError(self.path, "expected a video, found no frame that can be read")

    def facts(self) -> VideoFacts:
        """Size, rate and length. Raises: as `frames`."""
        with closing(self.frames()) as frames:
            width, height = next(frames).size
        with self._opened() as container:
            stream = self._stream(container)
            seconds = container.duration / _PER_SECOND if container.duration else None
            count = _stated_frames(container, stream)
            return VideoFacts(width, height, _rate(stream), count, seconds)

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)

    def _opened(self) -> InputContainer:
        import av

        check_readable(self.path, "a video")
        try:
            # From PyAV 19 on, metadata that are not UTF-8 stop no reader, and nothing sets it.
            if int(av.__version__.split(".")[0]) >= 19:
                return av.open(str(self.path))
            return av.open(str(self.path), metadata_errors="replace")
        except av.FFmpegError as error:
            found = f"{kind_of(self.path)} ({one_line(error.strerror or error)})"
            raise FileFormatError(self.path, f"expected a video, found {found}") from None

    def _stream(self, container: InputContainer) -> VideoStream:
        if not container.streams.video:
            raise FileFormatError(self.path, "expected a video, found no picture track in it")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        if stream.width * stream.height > MAX_PIXELS:
            found = f"{stream.width}x{stream.height}"
            limit = f"at most {MAX_PIXELS // 1_000_000} megapixels"
            raise FileFormatError(self.path, f"expected {limit} a frame, found {found}")
        return stream


def _decoded(container: InputContainer, stream: VideoStream) -> Iterator[Frame]:
    """Raises: av.FFmpegError: where the stream breaks."""
    begin = (container.start_time or 0) / _PER_SECOND
    aspect = float(stream.sample_aspect_ratio or 1)
    size: tuple[int, int] | None = None
    for count, raw in enumerate(container.decode(stream)):
        size = size or (max(1, round(raw.width * aspect)), raw.height)
        seconds = count / _rate(stream) if raw.time is None else raw.time - begin
        yield Frame(count, seconds, size, raw)


def _rate(stream: VideoStream) -> float:
    return float(stream.average_rate or _USUAL_RATE)


def _stated_frames(container: InputContainer, stream: VideoStream) -> int:
    """As the file says, or as its stated length tells; 0 when there is none."""
    return stream.frames or round((container.duration or 0) / _PER_SECOND * _rate(stream))
