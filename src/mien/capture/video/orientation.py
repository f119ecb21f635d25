"""Clips that lie on their side or upside-down without saying so."""

from __future__ import annotations

from collections import Counter
from contextlib import closing

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo, shrunk
from mien.capture.video.video import Video
from mien.errors import EstimationError

_SECONDS = 0.4
"""Between frames that are looked at."""
_LOOKS = 24
_AGREE = 3
"""Frames that must show the head the same way up."""
_SIDE = 640
_HOW = {
    1: "lie on their side: they are turned by 90 degrees counterclockwise",
    2: "are upside-down: they are turned by 180 degrees",
    3: "lie on their side: they are turned by 90 degrees clockwise",
}
_UP = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
"""Where up is, x right and y down, in pictures that so many turns counterclockwise make upright."""


def turn_upright(video: Video, detector: LandmarkDetector) -> bool:
    """Have the video's pictures turned, with a note, if the head in them is not upright; whether.

    The first ten seconds are looked at, as closely as a photo, until three frames agree.

    Raises:
        as Video.frames.
    """
    quarters = _quarters(video, detector)
    if not quarters:
        return False
    video.quarters = (video.quarters + quarters) % 4
    video.notes.append(f"its pictures {_HOW[quarters]}")
    return True


def _quarters(video: Video, detector: LandmarkDetector) -> int:
    found: Counter[int] = Counter()
    due, looks = -np.inf, 0
    with closing(video.frames()) as frames:
        for frame in frames:
            if frame.seconds < due:
                continue
            due, looks = frame.seconds + _SECONDS, looks + 1
            quarters = _needed(frame.pixels(max_side=_SIDE), video, detector)
            if quarters is not None:
                found[quarters] += 1
                if found[quarters] == _AGREE:
                    break
            if looks == _LOOKS:
                break
    return found.most_common(1)[0][0] if found else 0


def _needed(pixels: UInt8[Array, "h w 3"], video: Video, detector: LandmarkDetector) -> int | None:
    """Quarter turns that make the head upright; None where no face is found."""
    try:
        landmarks = detector.detect(Photo("frame", video.path, shrunk(pixels, _SIDE)))
    except EstimationError:
        return None
    return int((_UP @ landmarks.R_cam_head[:2, 1]).argmax())
