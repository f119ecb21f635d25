"""A video of a track: the frame, the drawn face blended over it, and the drawn head."""

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
from mien.report.track.caption import frame_caption, mark_lost
from mien.report.track.comparison import draw_tracked_head
from mien.report.track.window import Window, crop_window
from mien.track.state import Track, TrackedFrame

TrackedPixels = Iterable[tuple[UInt8[Array, "h w 3"], TrackedFrame]]
"""Pixels of frames, and what was tracked in them."""

PANELS = 3
MAX_WIDTH, MAX_HEIGHT = 1920, 1080
"""Of the overlay's pictures, px, their caption not counted."""
_MAX_GAP_SECONDS = 10.0
"""A gap between frames, where a clock jumps, counts as no longer than this."""


def save_overlay(
    path: str | Path,
    video: str | Path | Video,
    track: Track,
    head: Head | HeadRenderer,
    *,
    progress: StepProgress = no_step_progress,
) -> int:
    """Write the video, whole or not at all.

    Its rate is that of the track's shortest intervals; a frame that stays longer, in a video of
    variable rate or where frames are missing, is repeated, so that all keep their times.

    Args:
        path: .mp4 or .webm.
        video: that was tracked; it is decoded again.
        track: of the video.
        head: that was tracked.
        progress: called with the tracked frames done and their total.

    Returns:
        How many frames were written.

    Raises:
        InputError: another suffix, a video of another size than the track's, one without any of its
            frames, a place that cannot be written.
        FileFormatError: not a video.
    """
    fps, counts = repeat_counts(np.array([frame.time for frame in track.frames]), track.fps)

    def repeated(frames: TrackedPixels) -> Iterator[UInt8[Array, "h w 3"]]:
        progress(0, len(counts))
        pictures = zip(overlay_frames(frames, track, head), counts.tolist(), strict=False)
        for done, (picture, count) in enumerate(pictures, 1):
            yield from repeat(picture, count)
            progress(done, len(counts))

    with read_ahead(decode_tracked_frames(video, track), AHEAD) as frames:
        return save_video(path, repeated(frames), fps)


def overlay_frames(
    frames: TrackedPixels,
    track: Track,
    head: Head | HeadRenderer,
) -> Iterator[UInt8[Array, "h w 3"]]:
    """For every frame three panels side by side with a caption below.

    They are the frame, the frame with the drawn face blended over it, and the drawn head; of a lost
    frame only the first. Frames too large for panels within 1920 px are cropped to the bounds of
    the head in the whole track, and reduced in size if that is not enough.

    Args:
        frames: pixels, sRGB, as large as the track's or reduced, and what was tracked in them.
        track: that they are of.
        head: that was tracked.
    """
    renderer = head if isinstance(head, HeadRenderer) else HeadRenderer(head)
    window = crop_window(track, renderer.head, (MAX_WIDTH // PANELS, MAX_HEIGHT))
    for pixels, tracked in frames:
        frame = window.crop(pixels, track)
        panels = [frame, *_head_panels(frame, tracked, track, renderer, window)]
        picture = np.concatenate(panels, axis=1)
        yield np.concatenate([picture, frame_caption(tracked, picture.shape[1])])


def decode_tracked_frames(
    video: str | Path | Video, track: Track
) -> Generator[tuple[UInt8[Array, "h w 3"], TrackedFrame]]:
    """The frames of a video that a track has, with what was tracked in them.

    Args:
        video: that was tracked.
        track: of the video.

    Raises:
        InputError: a video of another size.
        FileFormatError: not a video.
    """
    by_number = {tracked.frame: tracked for tracked in track.frames}
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


def repeat_counts(times: Float[Array, " n"], fps: float) -> tuple[float, Int[Array, " n"]]:
    """A constant rate, and how often each frame is shown, once at least, to keep their times.

    Args:
        times: (N,) seconds. A jump back counts as no time, a jump ahead as ten seconds at most.
        fps: the rate where no two frames differ in time.
    """
    gaps = np.clip(np.diff(times), 0, _MAX_GAP_SECONDS)
    if not gaps.any():
        return fps, np.ones(len(times), np.int64)
    shortest = np.quantile(gaps[gaps > 0], 0.05)
    rate = 1 / gaps[np.abs(gaps / shortest - 1) < 0.25].mean()
    starts = np.rint(np.cumsum([0.0, *gaps]) * rate).astype(np.int64)
    counts = np.maximum(np.diff(starts), 1)
    return float(rate), np.append(counts, 1)


def _head_panels(
    frame: UInt8[Array, "h w 3"],
    tracked: TrackedFrame,
    track: Track,
    renderer: HeadRenderer,
    window: Window,
) -> tuple[UInt8[Array, "h w 3"], UInt8[Array, "h w 3"]]:
    """The face blended over the frame, and the head alone."""
    camera = None if tracked.state is None else window.camera(track, tracked.state)
    drawn = draw_tracked_head(renderer, track, tracked, camera)
    if drawn is None:
        empty = np.full_like(frame, GREY)
        return mark_lost(empty), empty
    return drawn.blended_over(frame), over_background(drawn.picture, GREY)[..., :3]
