"""Frames of a video as photos."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import closing

from mien.capture.images.photos import Photo, downscale
from mien.capture.video.video import Video


def frame_name(index: int) -> str:
    """What the photo made of a frame is called, by the frame's number from 0."""
    return f"frame_{index:06d}.png"


def fetch_frames(
    video: Video, wanted: Collection[int], max_side: int, on_frame: Callable[[int], None]
) -> Iterator[tuple[int, Photo]]:
    """The wanted frames as photos, with their numbers, in the clip's order.

    Args:
        video: the clip.
        wanted: numbers of frames.
        max_side: px; larger pictures are reduced to it.
        on_frame: called with the number of every frame that is read.
    """
    last = max(wanted, default=-1)
    with closing(video.frames()) as frames:
        for frame in frames:
            if frame.index > last:
                return
            on_frame(frame.index)
            if frame.index in wanted:
                pixels = frame.pixels()
                size = pixels.shape[1], pixels.shape[0]
                small = downscale(pixels, max_side)
                name = frame_name(frame.index)
                yield frame.index, Photo(name, video.path, small, original_size=size)
