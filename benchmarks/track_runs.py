"""A head tracked over frames that are at hand, with the time that each one takes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.head import Head
from mien.track.state import Track
from mien.track.tracker import Tracker

WARM_UP = 5
"""Frames whose time does not count: kernels load, and the first face is searched for."""


@dataclass(frozen=True)
class Followed:
    """What the tracker found, and how long it took.

    Attributes:
        track: of all frames.
        seconds: (N,) one a frame.
    """

    track: Track
    seconds: Float[Array, " n"]

    @property
    def frame_ms(self) -> float:
        """Median without the first frames."""
        return 1000 * float(np.median(self.seconds[WARM_UP:]))

    def count(self, status: str) -> int:
        """How many frames have this status."""
        return sum(frame.status == status for frame in self.track.frames)


def follow(
    head: Head,
    frames: Sequence[UInt8[Array, "h w 3"]],
    detector: LandmarkDetector,
    *,
    focal_px: float,
    fps: float,
) -> Followed:
    """Track these frames from the first to the last; without an initial state."""
    height, width = frames[0].shape[:2]
    tracker = Tracker(head, width, height, focal_px=focal_px, detector=detector)
    found, seconds = [], []
    for index, pixels in enumerate(frames):
        begun = time.perf_counter()
        found.append(tracker.step(pixels, index, index / fps))
        seconds.append(time.perf_counter() - begun)
    track = Track(tracker.layout, width, height, focal_px, fps, tuple(found))
    return Followed(track, np.array(seconds))
