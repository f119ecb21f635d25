"""Performances from files of either kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from mien.animate.curves import constant
from mien.animate.perform import moments
from mien.animate.timeline import Timeline
from mien.errors import InputError
from mien.formats.live_link import write_live_link
from mien.formats.timeline_file import load_performance
from mien.formats.timeline_json import save_timeline

TIMELINE = Timeline(0.5, tracks={"units.jawOpen": constant(0.25)})


def test_documents_and_recordings_are_told_apart(tmp_path: Path) -> None:
    save_timeline(tmp_path / "a.JSON", TIMELINE)
    write_live_link(tmp_path / "a.csv", moments(TIMELINE))
    for name in ("a.JSON", "a.csv"):
        assert load_performance(tmp_path / name).at(0.1).state.units == {"jawOpen": 0.25}


def test_other_kinds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.txt: expected a name that ends in \.json or \.csv"):
        load_performance(tmp_path / "a.txt")
