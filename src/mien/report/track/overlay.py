"""A video of what was tracked: the frame, the model over it, and the model alone."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from itertools import repeat
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int, UInt8
from mien.capture.video.frames_ahead import AHEAD, read_ahead
from mien.capture.video.video import Frame, Video
from mien.errors import InputError
from mien.head import Head
from mien.io.files.video import save_video
from mien.progress import StepProgress, no_step_progress
from mien.render.picture import GREY, HeadRenderer
from mien.render.shade import over_background
from mien.report.track.caption import caption, say_lost
from mien.report.track.comparison import draw_tracked
from mien.report.track.window import Window, window_of
from mien.track.state import Track, TrackedFrame

Frames = Iterable[tuple[UInt8[Array, "h w 3"], TrackedFrame]]
"""Pixels, and what was found in them."""

PANELS = 3
MAX_WIDTH, MAX_HEIGHT = 1920, 1080
"""Of the overlay's pictures, px, their caption not counted."""
_LONGEST_SECONDS = 10.0
"""That a frame is held where a clock jumps."""


def write_overlay(
    path: str | Path,
    video: str | Path | Video,
    track: Track,
    head: Head | HeadRenderer,
    *,
    progress: StepProgress = no_step_progress,
) -> int:
    """Write a video of what was tracked, whole or not at all.

    Its rate is that of the track's shortest intervals; a frame that stays longer, in a video of
    variable rate or where frames are missing, is repeated, so that all keep their times.

    Args:
        path: .mp4 or .webm.
        video: that was tracked; it is decoded again.
        progress: told the tracked frames done and their total.

    Returns:
        how many frames were written.

    Raises:
        InputError: another suffix, a video of another size than the track's, one without any of its
            frames, a place that cannot be written.
        FileFormatError: not a video.
    """
    fps, counts = held(np.array([found.time for found in track.frames]), track.fps)

    def shown(frames: Frames) -> Iterator[UInt8[Array, "h w 3"]]:
        progress(0, len(counts))
        pictures = zip(overlay_frames(frames, track, head), counts.tolist(), strict=False)
        for done, (picture, count) in enumerate(pictures, 1):
            yield from repeat(picture, count)
            progress(done, len(counts))

    with read_ahead(decoded(video, track), AHEAD) as frames:
        return save_video(path, shown(frames), fps)


def overlay_frames(
    frames: Frames,
    track: Track,
    head: Head | HeadRenderer,
) -> Iterator[UInt8[Array, "h w 3"]]:
    """For every frame a picture of it, beside it the frame with the drawn face over it, beside

    that the drawn head alone; a caption below. A lost frame is alone.

    Frames too large to stand side by side within 1920 px are cut to where the head goes in the
    whole track, and reduced in size if that is not enough.

    Args:
        frames: pixels, sRGB, as large as the track's or reduced, and what was found in them.
        track: that they are of.
    """
    renderer = head if isinstance(head, HeadRenderer) else HeadRenderer(head)
    window = window_of(track, renderer.head, (MAX_WIDTH // PANELS, MAX_HEIGHT))
    for pixels, found in frames:
        frame = window.cut(pixels, track)
        panels = [frame, *_drawn(frame, found, track, renderer, window)]
        picture = np.concatenate(panels, axis=1)
        yield np.concatenate([picture, caption(found, picture.shape[1])])


def decoded(
    video: str | Path | Video, track: Track
) -> Generator[tuple[UInt8[Array, "h w 3"], TrackedFrame]]:
    """The frames of a video that a track is of, with what was found in them.

    Raises:
        InputError: a video of another size.
        FileFormatError: not a video.
    """
    by_number = {found.frame: found for found in track.frames}
    last = max(by_number, default=-1)
    clip = video if isinstance(video, Video) else Video(Path(video))
    with closing(clip.frames()) as frames:
        for frame in frames:
            if frame.index in by_number:
                yield _pixels(frame, clip.path, track), by_number[frame.index]
            if frame.index >= last:
                return


def _pixels(frame: Frame, path: Path, track: Track) -> UInt8[Array, "h w 3"]:
    pixels = frame.pixels()
    if pixels.shape[:2] != (track.height, track.width):
        expected = f"{track.width}x{track.height} px as the track's video"
        raise InputError(path, expected, f"{pixels.shape[1]}x{pixels.shape[0]}")
    return pixels


def held(times: Float[Array, " n"], fps: float) -> tuple[float, Int[Array, " n"]]:
    """A constant rate, and how often it shows each frame for all to keep their times; once at

    least.

    Args:
        times: seconds. A clock that jumps back is taken to have stood still, one that jumps ahead
            to have gone on for ten seconds.
        fps: where there are no two frames that tell.
    """
    gaps = np.clip(np.diff(times), 0, _LONGEST_SECONDS)
    if not gaps.any():
        return fps, np.ones(len(times), np.int64)
    shortest = np.quantile(gaps[gaps > 0], 0.05)
    rate = 1 / gaps[np.abs(gaps / shortest - 1) < 0.25].mean()
    starts = np.rint(np.cumsum([0.0, *gaps]) * rate).astype(np.int64)
    counts = np.maximum(np.diff(starts), 1)
    return float(rate), np.append(counts, 1)


def _drawn(
    frame: UInt8[Array, "h w 3"],
    found: TrackedFrame,
    track: Track,
    renderer: HeadRenderer,
    window: Window,
) -> tuple[UInt8[Array, "h w 3"], UInt8[Array, "h w 3"]]:
    """The face over the frame, and the head alone."""
    camera = None if found.state is None else window.camera(track, found.state)
    drawn = draw_tracked(renderer, track, found, camera)
    if drawn is None:
        empty = np.full_like(frame, GREY)
        return say_lost(empty), empty
    return drawn.over(frame), over_background(drawn.picture, GREY)[..., :3]
