"""Frames of a video, decoded in a thread while earlier ones are processed."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

from mien.arrays import Array, UInt8
from mien.capture.video.video import Video

AHEAD = 4
"""Frames decoded ahead: enough to even out that some take longer than others."""

T = TypeVar("T")


@dataclass(frozen=True)
class DecodedFrame:
    """One frame, converted.

    Attributes:
        frame: counted from 0.
        seconds: since the clip's beginning.
        pixels: (H, W, 3) sRGB, upright.
    """

    frame: int
    seconds: float
    pixels: UInt8[Array, "h w 3"]


@contextmanager
def frames_ahead(
    video: Video, *, start: int = 0, max_side: int | None = None, ahead: int = AHEAD
) -> Iterator[Iterator[DecodedFrame]]:
    """The pictures of a video in order, while the block runs; at most `ahead` wait in memory.

    Decoding and converting run without Python's global lock, so in parallel with the block.
    Iterating raises what `Video.frames` raises.

    Args:
        video: the clip.
        start: the first that is wanted; those before are decoded but not converted.
        max_side: as for `Frame.pixels`.
        ahead: how many are decoded ahead.
    """
    with read_ahead(_pictures(video, start, max_side), ahead) as pictures:
        yield pictures


@contextmanager
def read_ahead(items: Generator[T], ahead: int) -> Iterator[Iterator[T]]:
    """The items in order, while the block runs, taken in a thread of their own.

    An error of the generator's comes where its next item would have come. When the block ends,
    however it does, the thread has ended and the generator is closed.
    """
    with closing(items), ThreadPoolExecutor(1, "mien-read-ahead") as thread:
        try:
            yield _in_turn(items, ahead, thread)
        finally:
            thread.shutdown(cancel_futures=True)


def _in_turn(items: Iterator[T], ahead: int, thread: Executor) -> Iterator[T]:
    def take() -> tuple[T, ...]:
        # A future cannot hold StopIteration: an empty tuple stands for the end.
        return tuple(islice(items, 1))

    waiting = deque(thread.submit(take) for _ in range(ahead))
    while item := waiting.popleft().result():
        waiting.append(thread.submit(take))
        yield item[0]


def _pictures(video: Video, start: int, max_side: int | None) -> Generator[DecodedFrame]:
    with closing(video.frames()) as frames:
        for frame in frames:
            if frame.index >= start:
                yield DecodedFrame(frame.index, frame.seconds, frame.pixels(max_side=max_side))
