"""Timelines from files of any kind that holds one; the suffix tells the kind."""

from __future__ import annotations

from pathlib import Path

from mien.animate.timeline import Timeline
from mien.errors import InputError


def load_timeline(path: str | Path) -> Timeline:
    """The timeline in a .json document, a Live Link Face .csv recording or a TRACK.csv.

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


def _load_table(path: str | Path) -> Timeline:
    from mien.animate.from_track import track_timeline
    from mien.io.live.live_link_read import load_live_link
    from mien.io.tracks.track_csv import is_track, load_track

    if not is_track(path):
        return load_live_link(path)
    track = load_track(path)
    if all(frame.state is None for frame in track.frames):
        raise InputError(path, "a track with at least one frame that shows a face", "none")
    return track_timeline(track)
