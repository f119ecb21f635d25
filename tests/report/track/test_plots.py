from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from filmed import written
from mien.errors import InputError
from mien.render.picture import GREY
from mien.report.track.charts import build_plots
from mien.report.track.plots import (
    check_plots_place,
    contact_sheet,
    error_summary,
    pick_evenly,
    save_track_plots,
    summary,
)
from mien.track.series import series_of, truth_for
from mien.track.state import Layout, Track
from posable import head
from tracks import random_state, random_track, track_of

SMALL = Layout(("mouth",), ("neutral", "joy"))


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    states = [random_state(rng, SMALL), None, random_state(rng, SMALL)]
    return replace(track_of(states, rng, layout=SMALL), width=64, height=48, focal_px=110.0)


def test_every_plot_and_a_page_that_shows_them(tmp_path: Path, track: Track) -> None:
    told: list[tuple[int, int]] = []
    files = save_track_plots(
        tmp_path / "a" / "plots", track, progress=lambda *step: told.append(step)
    )
    names = [plot.name for plot in build_plots(track)]
    assert [file.name for file in files] == [*(f"{name}.png" for name in names), "index.html"]
    assert {file.name for file in files} == {path.name for path in files[0].parent.iterdir()}
    assert told == [(step, len(files)) for step in range(len(files) + 1)]
    page = files[-1].read_text(encoding="utf-8")
    assert re.findall(r'<img src="([^"]*)"', page) == [file.name for file in files[:-1]]
    assert "http" not in page


def test_a_contact_sheet_where_there_is_a_video(tmp_path: Path, track: Track) -> None:
    clip = written(tmp_path / "in.mp4", [np.full((48, 64, 3), 90, np.uint8)] * 3)
    files = save_track_plots(tmp_path / "plots", track, video=clip, head=head(), kind="svg")
    assert files[0].name == "sheet.jpg"
    assert '<img src="sheet.jpg"' in files[-1].read_text(encoding="utf-8")
    assert files[1].read_text(encoding="utf-8").startswith("<?xml")


def test_other_files_are_left_alone(tmp_path: Path, track: Track) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "rms.png").write_text("old")
    save_track_plots(tmp_path, track)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "rms.png").read_bytes().startswith(b"\x89PNG")


def test_the_title_is_escaped(tmp_path: Path, track: Track) -> None:
    page = save_track_plots(tmp_path, track, title="a <b> & c")[-1].read_text(encoding="utf-8")
    assert "<h1>a &lt;b&gt; &amp; c</h1>" in page


def test_key_figures(rng: np.random.Generator) -> None:
    track = random_track(rng)
    told = dict(summary(track, series_of(track)))
    assert told["pictures"] == "640x360 px, focal length 812 px"
    assert told["frames"] == "9, 25.00 a second"
    assert told["found anew, lost"] == "1, 2"
    rms = [found.rms for found in track.frames if found.state is not None]
    mean, most = np.mean(rms), np.max(rms)
    assert told["RMS error, grey levels"] == f"{mean:.1f} on average, {most:.1f} at most"


def test_error_summary(rng: np.random.Generator) -> None:
    track = random_track(rng)
    moved = tuple(
        replace(found, state=replace(found.state, t_cam_head=1.01 * found.state.t_cam_head))
        if found.state
        else found
        for found in track.frames
    )
    truth = truth_for(track, track)
    told = dict(error_summary(series_of(replace(track, frames=moved)), truth))
    assert told == {
        "rotation off by, degrees": "0.000 on average, 0.000 at most",
        "translation off by, % of the distance": "1.000 on average, 1.000 at most",
        "weights off by": "0.000 on average, 0.000 at most",
    }
    lost = series_of(track_of([None] * 9, rng))
    assert dict(error_summary(lost, truth))["weights off by"] == "not known"


def test_a_track_of_which_all_is_lost(tmp_path: Path, rng: np.random.Generator) -> None:
    track = track_of([None, None], rng, layout=SMALL)
    page = save_track_plots(tmp_path, track, reference=track)[-1].read_text(encoding="utf-8")
    assert "RMS error, grey levels" not in page
    assert "not known" in page


def test_nothing_to_plot(tmp_path: Path, track: Track) -> None:
    with pytest.raises(InputError, match="track: expected at least one frame, got none"):
        save_track_plots(tmp_path, replace(track, frames=()))
    with pytest.raises(InputError, match="kind: expected png or svg, got pdf"):
        save_track_plots(tmp_path, track, kind="pdf")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        save_track_plots(tmp_path / "file", track)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_another_page_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<title>my site</title>")
    with pytest.raises(InputError, match=r"index\.html: expected a free place for the page"):
        check_plots_place(tmp_path)
    assert (tmp_path / "index.html").read_text() == "<title>my site</title>"


def test_plots_may_be_drawn_again(tmp_path: Path, track: Track) -> None:
    for _ in range(2):
        check_plots_place(tmp_path / "plots")
        save_track_plots(tmp_path / "plots", track)


@pytest.fixture
def clip_track(rng: np.random.Generator) -> Track:
    made = track_of([random_state(rng), None, random_state(rng)], rng)
    return replace(made, width=80, height=60, focal_px=150.0)


def test_frames_are_picked_evenly(rng: np.random.Generator) -> None:
    track = random_track(rng)
    assert [found.frame for found in pick_evenly(track, 3).frames] == [0, 4, 8]
    assert pick_evenly(track, 1).frames == track.frames[:1]
    assert pick_evenly(track, 99) == track


@pytest.mark.parametrize(("columns", "shape"), [(3, (120, 248)), (2, (244, 164)), (9, (120, 248))])
def test_sheet_of_frames_above_drawn_heads(
    clip_track: Track, columns: int, shape: tuple[int, int]
) -> None:
    track = clip_track
    frames = [np.full((60, 80, 3), 60 * (index + 1), np.uint8) for index in range(3)]
    pairs = zip(frames, track.frames, strict=True)
    sheet = contact_sheet(pairs, track, head(), columns=columns)
    assert sheet.shape == (*shape, 3)
    for index, frame in enumerate(frames):
        row, column = divmod(index, columns)
        top, left = 124 * row, 84 * column
        cell = sheet[top : top + 120, left : left + 80]
        assert (cell[20:60] == frame[20:]).all(), "but for its number"
        drawn = (cell[60:] != GREY).any(axis=2).mean()
        assert drawn < 0.1 if track.frames[index].state is None else drawn > 0.2
