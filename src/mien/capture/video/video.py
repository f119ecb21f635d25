"""Frames of a video, upright and in order."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mien.arrays import Array, UInt8, UInt16
from mien.capture.images.hdr import HDR, hdr_to_srgb
from mien.capture.images.opening import MAX_PIXELS, is_image
from mien.capture.video.display_matrix import DisplayTransform, display_transform
from mien.errors import FileFormatError, one_line
from mien.reading.files import check_readable, describe_content

if TYPE_CHECKING:
    from av import VideoFrame
    from av.container import InputContainer
    from av.video.plane import VideoPlane
    from av.video.stream import VideoStream

CONTAINERS = (
    "mov",
    "matroska",
    "webm",
    "avi",
    "mpegts",
    "mpeg",
    "mpegvideo",
    "asf",
    "flv",
    "ogg",
    "mxf",
    "dv",
    "rm",
    "ivf",
    "h264",
    "hevc",
    "gif",
    "apng",
    # These are opened to say that they hold no pictures.
    "wav",
    "mp3",
    "aac",
    "flac",
)
"""FFmpeg's names of the formats that are read. It has others: lists of files or addresses that it
would open, or single pictures."""

_OPTIONS = {"format_whitelist": ",".join(CONTAINERS), "protocol_whitelist": "file"}
_USUAL_RATE = 25
_ATTACHED_PICTURE = 0x400  # FFmpeg's AV_DISPOSITION_ATTACHED_PIC
_UNSPECIFIED, _BT2020 = 2, 9  # Codes of matrix coefficients
_PER_SECOND = 1e6  # FFmpeg's unit of a container's times


@dataclass(frozen=True)
class Frame:
    """One decoded picture, not yet converted.

    Attributes:
        index: from 0, in order of display.
        seconds: since the clip's beginning.
        stored_size: width and height of the clip's pictures before they are turned upright, px,
            their pixels made square.
        display: how they are turned.
        raw: as the decoder gave it; of another size where a clip changes it on its way.
    """

    index: int
    seconds: float
    stored_size: tuple[int, int]
    display: DisplayTransform
    raw: VideoFrame

    @property
    def hdr(self) -> str:
        """The HDR transfer characteristic, "HLG" or "PQ"; "" for a picture that is not HDR."""
        return HDR.get(self.raw.color_trc, "")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its pixels, px."""
        return self.display.size(*self.stored_size)

    def pixels(self, *, max_side: int | None = None) -> UInt8[Array, "h w 3"]:
        """(H, W, 3) sRGB with square pixels, as players show it: turned, mirrored, HDR mapped.

        Args:
            max_side: px; a picture whose longer side is longer is reduced to it by averaging while
                its colours are converted, which takes less than doing one after the other.
        """
        factor = min(1.0, (max_side or np.inf) / max(self.stored_size))
        width, height = (max(1, round(side * factor)) for side in self.stored_size)
        # The scaler's quickest way, "FAST_BILINEAR", shifts pictures by most of a pixel.
        how = "AREA" if height < self.raw.height else "BILINEAR"
        if self.hdr:
            codes = _sixteen_bits(self.raw, width, height, how)
            stored = hdr_to_srgb(codes, self.raw.color_trc, self.raw.color_primaries)
        else:
            stored = self.raw.to_ndarray(
                format="rgb24", width=width, height=height, interpolation=how
            )
        return self.display.apply(stored)


@dataclass(frozen=True)
class VideoInfo:
    """Size, rate and length of a clip, as the file states them and its first picture shows.

    Attributes:
        width: of the upright pictures, px.
        height: of the upright pictures, px.
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
        quarters: turns counterclockwise of every picture, beyond those that the file states.
        notes: grow while frames are read: a stream that breaks, frames that cannot be decoded.
    """

    path: Path
    quarters: int = 0
    notes: list[str] = field(default_factory=list)

    def frames(self) -> Generator[Frame]:
        """Every frame in order of display. A stream that breaks half-way ends there, with a note.

        Raises:
            InputError: no such file, not a file, it may not be read.
            FileFormatError: not a video, no frames, too large.
        """
        import av

        count = 0
        with self._opened() as container:
            stream = self._stream(container)
            try:
                for frame in _decoded(container, stream, self.quarters):
                    if frame.hdr:
                        self._note(f"HDR video ({frame.hdr}): its colours are mapped to sRGB")
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

    def info(self) -> VideoInfo:
        """Size, rate and length. Raises: as `frames`."""
        with closing(self.frames()) as frames:
            width, height = next(frames).size
        with self._opened() as container:
            stream = self._stream(container)
            seconds = container.duration / _PER_SECOND if container.duration else None
            count = _stated_frames(container, stream)
            return VideoInfo(width, height, _rate(stream), count, seconds)

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)

    def _opened(self) -> InputContainer:
        check_readable(self.path, "a video")
        return _open(self.path)

    def _stream(self, container: InputContainer) -> VideoStream:
        stream = _picture_stream(container)
        if stream is None:
            raise FileFormatError(self.path, "expected a video, found no picture track in it")
        stream.thread_type = "AUTO"
        if stream.width * stream.height > MAX_PIXELS:
            found = f"{stream.width}x{stream.height}"
            limit = f"at most {MAX_PIXELS // 1_000_000} megapixels"
            raise FileFormatError(self.path, f"expected {limit} a frame, found {found}")
        return stream


def is_video(path: Path) -> bool:
    """Whether the file begins like a video, whatever its name."""
    try:
        with _open(path) as container:
            return _picture_stream(container) is not None
    except FileFormatError:
        return False


def _open(path: Path) -> InputContainer:
    import av

    # Up to PyAV 18 text that is not UTF-8 fails by default.
    lenient = {"metadata_errors": "replace"} if int(av.__version__.split(".")[0]) < 19 else {}
    try:
        # Without "file:" a name like "concat:a" would be an address.
        return av.open(f"file:{path}", container_options=_OPTIONS, **lenient)  # type: ignore[call-overload]
    except av.FFmpegError as error:
        reason = one_line(error.strerror or error)
        found = "a photo" if is_image(path) else f"{describe_content(path)} ({reason})"
        raise FileFormatError(path, f"expected a video, found {found}") from None


def _picture_stream(container: InputContainer) -> VideoStream | None:
    """The first video track that is not the cover of a piece of music."""
    return next((stream for stream in container.streams.video if not _is_cover(stream)), None)


def _is_cover(stream: VideoStream) -> bool:
    # Early versions of PyAV 14 have no disposition.
    disposition = getattr(stream, "disposition", None)
    return disposition is not None and bool(disposition.value & _ATTACHED_PICTURE)


def _decoded(container: InputContainer, stream: VideoStream, quarters: int) -> Iterator[Frame]:
    """Raises: av.FFmpegError: where the stream breaks."""
    begin = (container.start_time or 0) / _PER_SECOND
    aspect = float(stream.sample_aspect_ratio or 1)
    size: tuple[int, int] | None = None
    display = DisplayTransform()
    for count, raw in enumerate(container.decode(stream)):
        if size is None:
            size = max(1, round(raw.width * aspect)), raw.height
            display = display_transform(raw).turned(quarters)
        seconds = count / _rate(stream) if raw.time is None else raw.time - begin
        yield Frame(count, seconds, size, display, raw)


def _sixteen_bits(raw: VideoFrame, width: int, height: int, how: str) -> UInt16[Array, "h w 3"]:
    """R'G'B' of an HDR picture over the full range."""
    # BT.2020 is the default of HDR pictures whose file states no matrix.
    matrix = _BT2020 if raw.colorspace == _UNSPECIFIED else raw.colorspace
    # Planes, as FFmpeg 8.0 spoils pictures whose 16 bits are not in planes.
    shown = raw.reformat(width, height, "gbrp16le", src_colorspace=matrix, interpolation=how)
    green, blue, red = (_values(plane) for plane in shown.planes)
    return np.stack([red, green, blue], axis=-1)


def _values(plane: VideoPlane) -> UInt16[Array, "h w"]:
    rows = np.frombuffer(memoryview(plane), "<u2").reshape(plane.height, plane.line_size // 2)
    return rows[:, : plane.width].astype(np.uint16, copy=False)


def _rate(stream: VideoStream) -> float:
    return float(stream.average_rate or _USUAL_RATE)


def _stated_frames(container: InputContainer, stream: VideoStream) -> int:
    """As the file states it, or by its stated length; 0 when there is neither."""
    return stream.frames or round((container.duration or 0) / _PER_SECOND * _rate(stream))
