"""Timelines from files of any kind that holds one, and whether a head can perform them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from mien.animate.channels import CHANNEL_NAMES, REGION_NAMES, UNITS, split_channel
from mien.animate.timeline import Timeline, Tracks
from mien.errors import FileFormatError, InputError
from mien.reading.strict_json import unknown_name


def load_timeline(path: str | Path) -> Timeline:
    """The timeline in a .json document, a Live Link Face .csv recording or a TRACK.csv.

    Args:
        path: the file; its suffix and its first line tell the kind.

    Raises:
        InputError: another suffix, a file that cannot be read, a track without a face.
        FileFormatError: as load_timeline_json, load_live_link and load_track.
    """
    from mien.io.timeline.timeline_json import load_timeline_json

    loaders = {".json": load_timeline_json, ".csv": _load_table}
    suffix = Path(path).suffix.lower()
    if suffix not in loaders:
        raise InputError(path, f"a name that ends in {' or '.join(loaders)}", suffix or "no suffix")
    return loaders[suffix](path)


def timeline_files(path: str | Path) -> list[Path]:
    """The files that load_timeline reads: of a track what lies beside it, too."""
    from mien.io.tracks.track_json import sidecar_of

    path = Path(path)
    return [path, sidecar_of(path)] if path.suffix.lower() == ".csv" else [path]


def check_timeline(
    timeline: Timeline,
    *,
    expressions: Collection[str],
    units: Collection[str],
    regions: Collection[str] = REGION_NAMES,
    path: str | Path = "timeline",
) -> None:
    """Refuse a timeline that moves what a head does not have.

    Args:
        timeline: what the head is to perform.
        expressions: names of the head's expressions.
        units: names of its face units.
        regions: names of its regions.
        path: how the message calls the timeline.

    Raises:
        FileFormatError: names the place, suggests the nearest names.
    """
    for place, channel in _channels(timeline):
        group, name = split_channel(channel)
        if group in CHANNEL_NAMES:
            continue
        if group != UNITS and group not in regions:
            raise FileFormatError(path, unknown_name("region", group, regions), place)
        known, kind = (units, "unit") if group == UNITS else (expressions, "expression")
        if name not in known:
            raise FileFormatError(path, unknown_name(kind, name, known), place)


def _load_table(path: str | Path) -> Timeline:
    from mien.animate.from_track import track_timeline
    from mien.io.live.live_link_csv import load_live_link
    from mien.io.tracks.track_csv import is_track, load_track

    if not is_track(path):
        return load_live_link(path)
    track = load_track(path)
    if all(frame.state is None for frame in track.frames):
        raise InputError(path, "a track with at least one frame that shows a face", "none")
    return track_timeline(track)


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
