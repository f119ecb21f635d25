"""Performances from files of any kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mien.animate.curves import constant
from mien.animate.from_track import track_moments
from mien.animate.timeline import Timeline
from mien.errors import InputError
from mien.io.live.live_link_csv import save_live_link
from mien.io.timeline.timeline_file import load_timeline
from mien.io.timeline.timeline_json import save_timeline
from mien.io.tracks.track_csv import save_track
from moments import moments
from tracks import random_track, track_of

TIMELINE = Timeline(0.5, tracks={"units.jawOpen": constant(0.25)})


def test_documents_and_recordings_are_distinguished(tmp_path: Path) -> None:
    save_timeline(tmp_path / "a.JSON", TIMELINE)
    save_live_link(tmp_path / "a.csv", moments(TIMELINE))
    for name in ("a.JSON", "a.csv"):
        assert load_timeline(tmp_path / name).at(0.1).state.units == {"jawOpen": 0.25}


def test_other_kinds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.txt: expected a name that ends in \.json or \.csv"):
        load_timeline(tmp_path / "a.txt")


def test_tracks_are_performances_too(tmp_path: Path, rng: np.random.Generator) -> None:
    track = random_track(rng)
    save_track(tmp_path / "TRACK.csv", track)
    found = load_timeline(tmp_path / "TRACK.csv").at(0.04).state
    wanted = track.frames[1].state.face(track.layout)
    assert found.units == pytest.approx(wanted.units)
    assert found.expressions["mouth"] == pytest.approx(wanted.expressions["mouth"])


def test_a_track_plays_as_live_link(tmp_path: Path, rng: np.random.Generator) -> None:
    track = random_track(rng)
    assert save_live_link(tmp_path / "a.csv", track_moments(track)) == 9
    found = load_timeline(tmp_path / "a.csv").at(0.08)
    moment = list(track_moments(track))[2]
    assert found.state.units["jawOpen"] == pytest.approx(moment.state.units["jawOpen"])
    np.testing.assert_allclose(found.rotation, moment.rotation, atol=1e-6)


def test_a_track_without_a_face_names_its_file(tmp_path: Path, rng: np.random.Generator) -> None:
    save_track(tmp_path / "a.csv", track_of([None], rng))
    with pytest.raises(InputError, match=r"a\.csv: expected a track with at least one frame that"):
        load_timeline(tmp_path / "a.csv")
