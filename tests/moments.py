"""The moments of a timeline, one a frame."""

from __future__ import annotations

from collections.abc import Iterator

from mien.animate.perform import frame_times
from mien.animate.timeline import Moment, Timeline


def moments(timeline: Timeline) -> Iterator[Moment]:
    """Face and head at every frame."""
    return timeline.moments_at(frame_times(timeline))
