"""Clips that lie on their side or upside-down although their file states no turn."""

from __future__ import annotations

from collections import Counter
from contextlib import closing

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo, downscale
from mien.capture.video.video import Video
from mien.errors import EstimationError

_SECONDS = 0.4
"""Between frames in which the head is searched."""
_MAX_FRAMES = 24
_MIN_AGREEING = 3
"""Frames that must show the head the same way up."""
_SIDE = 640
_NOTES = {
    1: "lie on their side: they are turned by 90 degrees counterclockwise",
    2: "are upside-down: they are turned by 180 degrees",
    3: "lie on their side: they are turned by 90 degrees clockwise",
}
_UP = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
"""The direction up, x right and y down, in pictures that need so many turns counterclockwise."""


def turn_upright(video: Video, detector: LandmarkDetector) -> bool:
    """Turn the video's pictures, with a note, if the head in them is not upright.

    The head is searched in the first ten seconds, as in a photo, until three frames agree.

    Returns:
        whether they are turned.

    Raises:
        InputError: as Video.frames.
        FileFormatError: as Video.frames.
    """
    quarters = _quarters(video, detector)
    if not quarters:
        return False
    video.quarters = (video.quarters + quarters) % 4
    video.notes.append(f"its pictures {_NOTES[quarters]}")
    return True


def _quarters(video: Video, detector: LandmarkDetector) -> int:
    found: Counter[int] = Counter()
    due, frames_tried = -np.inf, 0
    with closing(video.frames()) as frames:
        for frame in frames:
            if frame.seconds < due:
                continue
            due, frames_tried = frame.seconds + _SECONDS, frames_tried + 1
            quarters = _turns_needed(frame.pixels(max_side=_SIDE), video, detector)
            if quarters is not None:
                found[quarters] += 1
                if found[quarters] == _MIN_AGREEING:
                    break
            if frames_tried == _MAX_FRAMES:
                break
    return found.most_common(1)[0][0] if found else 0


def _turns_needed(
    pixels: UInt8[Array, "h w 3"], video: Video, detector: LandmarkDetector
) -> int | None:
    """Quarter turns that make the head upright; None where no face is found."""
    try:
        landmarks = detector.detect(Photo("frame", video.path, downscale(pixels, _SIDE)))
    except EstimationError:
        return None
    return int((_UP @ landmarks.R_cam_head[:2, 1]).argmax())
