"""Live pictures: what every live source gives, and a video played as if it were a camera."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from mien.arrays import Array, UInt8
from mien.capture.video.frames_ahead import AHEAD, read_ahead
from mien.capture.video.video import Frame, Video


class UnconvertedPicture(Protocol):
    """A picture that is not yet converted; `mien.capture.video.video.Frame` is one."""

    def pixels(self, *, max_side: int | None = None) -> UInt8[Array, "h w 3"]:
        """As `LiveFrame.pixels`."""


@dataclass(frozen=True)
class LiveFrame:
    """A picture with its time.

    Attributes:
        index: from 0; those that were dropped are counted.
        seconds: since the source's first picture.
        taken: when it was, by the source's clock.
        picture: the picture.
    """

    index: int
    seconds: float
    taken: float
    picture: UnconvertedPicture

    def pixels(self, *, max_side: int | None = None) -> UInt8[Array, "h w 3"]:
        """(H, W, 3) sRGB, upright; reduced where its longer side is longer than `max_side` px."""
        return self.picture.pixels(max_side=max_side)


class LiveSource(Protocol):
    """A source of pictures in real time.

    Attributes:
        width: of the upright pictures, px.
        height: of the upright pictures, px.
        fps: frames a second, as stated.
        dropped: how many pictures were not read in time.
        notes: what was odd; grows while frames are read.
    """

    width: int
    height: int
    fps: float
    dropped: int
    notes: list[str]

    def frames(self) -> Generator[LiveFrame]:
        """The newest picture whenever one is asked for, waiting for it if need be."""

    def close(self) -> None:
        """Release the device; a second time does nothing."""


class PacedVideo:
    """A video file played as if it were a camera: a picture is there when its time has come.

    Args:
        path: the video.
        clock: gives the time in seconds.
        sleep: waits for so many seconds.

    Raises:
        InputError: as `Video.frames`.
        FileFormatError: as `Video.frames`.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._video, self._clock, self._sleep = Video(Path(path)), clock, sleep
        facts = self._video.info()
        self.width, self.height, self.fps = facts.width, facts.height, facts.fps
        self.dropped = 0
        self.notes = self._video.notes

    def frames(self) -> Generator[LiveFrame]:
        """Pictures in their own time, which starts with the first; late ones are dropped."""
        with read_ahead(self._video.frames(), AHEAD) as frames:
            yield from self._paced(frames)

    def close(self) -> None:
        """Nothing is held between frames."""

    def _paced(self, frames: Iterable[Frame]) -> Iterator[LiveFrame]:
        start: float | None = None
        for frame, following in _with_following(frames):
            if start is None:
                start = self._clock() - frame.seconds
            # A camera holds no picture back: one whose successor is there already is gone.
            if following is not None and start + following.seconds <= self._clock():
                self.dropped += 1
                continue
            due = start + frame.seconds
            wait = due - self._clock()
            if wait > 0:
                self._sleep(wait)
            yield LiveFrame(frame.index, frame.seconds, due, frame)


def _with_following(frames: Iterable[Frame]) -> Iterator[tuple[Frame, Frame | None]]:
    """Every frame with the one after it; None after the last."""
    before: Frame | None = None
    for frame in frames:
        if before is not None:
            yield before, frame
        before = frame
    if before is not None:
        yield before, None
