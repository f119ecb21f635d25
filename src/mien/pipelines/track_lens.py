"""The lens of a video that `mien track` is told nothing of."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from mien.arrays import Array, UInt8
from mien.capture.video.frames_ahead import frames_ahead
from mien.capture.video.video import Video, VideoInfo
from mien.pipelines.tracking.ready_head import ReadyHead
from mien.progress import Progress
from mien.track.landmarks.focal import estimate_focal
from mien.track.lens import expected_focal

LENS = "Finding the focal length"
_FIRST, _EVERY, _SIDE = 300, 5, 1280
"""Which frames are looked at, and how large: the detector sees no more in larger ones."""


def find_focal(
    clip: Video, facts: VideoInfo, ready: ReadyHead, tell: Progress
) -> tuple[float, str]:
    """Focal length of a clip's pictures in px, from the first of them, and a note on it.

    Args:
        tell: told LENS, the frames done and their total.
    """
    total = min(facts.frames or _FIRST, _FIRST)
    tell(LENS, 0, total)  # at once: making the head ready takes seconds
    expected = expected_focal(ready.head, facts.width, facts.height)
    tracker = ready.tracker(facts.width, facts.height, expected.focal_px)
    frames = _first(clip, total, tell)
    found = estimate_focal(frames, ready.head_detector, ready.head, is_match=tracker.resembles)
    reduced = min(1.0, _SIDE / max(facts.width, facts.height))
    return found.focal_px / reduced, found.note


def _first(clip: Video, total: int, tell: Progress) -> Iterator[UInt8[Array, "h w 3"]]:
    with frames_ahead(clip, max_side=_SIDE) as pictures:
        for picture in islice(pictures, 0, _FIRST, _EVERY):
            yield picture.pixels
            tell(LENS, min(picture.frame + _EVERY, total), total)
