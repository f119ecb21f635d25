"""Timelines from files of any kind that holds one; the suffix tells the kind."""

from __future__ import annotations

from pathlib import Path

from mien.animate.timeline import Timeline
from mien.errors import InputError


def load_performance(path: str | Path) -> Timeline:
    """The timeline in a .json document or a Live Link Face .csv recording.

    Raises: InputError: another suffix, a file that cannot be read. FileFormatError: as
        load_timeline and load_live_link.
    """
    from mien.formats.live_link_read import load_live_link
    from mien.formats.timeline_json import load_timeline

    loaders = {".json": load_timeline, ".csv": load_live_link}
    suffix = Path(path).suffix.lower()
    if suffix not in loaders:
        raise InputError(path, f"a name that ends in {' or '.join(loaders)}", suffix or "no suffix")
    return loaders[suffix](path)
