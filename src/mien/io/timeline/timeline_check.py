"""Whether a head can do what a timeline asks of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from mien.animate.channels import MEMBERS, REGIONS, UNITS, split
from mien.animate.timeline import Timeline, Tracks
from mien.errors import FileFormatError
from mien.reading.strict_json import unknown


def check_timeline(
    timeline: Timeline,
    *,
    expressions: Collection[str],
    units: Collection[str],
    regions: Collection[str] = REGIONS,
    path: str | Path = "timeline",
) -> None:
    """Refuse a timeline that moves what a head does not have.

    Args:
        expressions: the head's names.
        units: the head's names.
        regions: the head's names.
        path: how the message calls the timeline.

    Raises:
        FileFormatError: names the place, suggests the nearest names.
    """
    for place, channel in _channels(timeline):
        group, name = split(channel)
        if group in MEMBERS:
            continue
        if group != UNITS and group not in regions:
            raise FileFormatError(path, unknown("region", group, regions), place)
        known, kind = (units, "unit") if group == UNITS else (expressions, "expression")
        if name not in known:
            raise FileFormatError(path, unknown(kind, name, known), place)


def _channels(timeline: Timeline) -> Iterator[tuple[str, str]]:
    """Where in the document a channel is moved, and which one."""
    motions: list[tuple[str, Tracks]] = [("tracks", timeline.tracks)]
    motions += [(f"clips.{name}.tracks", clip.tracks) for name, clip in timeline.clips.items()]
    for index, layer in enumerate(timeline.layers):
        motions.append((f"layers[{index}].tracks", layer.tracks))
        if layer.generator is not None:
            made = layer.generator.channels(timeline.duration)
            motions.append((f"layers[{index}].generator", made))
    return ((f"{place}.{channel}", channel) for place, tracks in motions for channel in tracks)
