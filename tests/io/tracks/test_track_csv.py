"""TRACK.csv and TRACK.json: what is written comes back, what is bad is told in one line."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mien.errors import FileFormatError, InputError
from mien.io.tracks.track_csv import (
    check_track_place,
    columns_of,
    is_track,
    load_track,
    save_track,
)
from mien.track.state import Layout, Track, TrackedFrame, TrackState
from tracks import LAYOUT, frame_of, random_state, random_track, track_of

NEUTRAL_ONLY = Layout(("mouth",), ("neutral",), ("jawOpen",))
BARE = Layout((), ("neutral",))


def assert_same_frame(found: TrackedFrame, given: TrackedFrame, tolerance: float) -> None:
    assert (found.frame, found.status) == (given.frame, given.status)
    for name in ("time", "rms", "seen", "deviations", "gain", "bias"):
        wanted = getattr(given, name)
        np.testing.assert_allclose(getattr(found, name), wanted, rtol=0, atol=tolerance)
    assert (found.state is None) == (given.state is None)
    for name in TrackState.__dataclass_fields__ if given.state else ():
        wanted = getattr(given.state, name)
        np.testing.assert_allclose(getattr(found.state, name), wanted, rtol=0, atol=tolerance)


@pytest.mark.parametrize("layout", [LAYOUT, NEUTRAL_ONLY, BARE], ids=["all", "neutral", "bare"])
def test_a_track_round_trips(tmp_path: Path, rng: np.random.Generator, layout: Layout) -> None:
    track = random_track(rng, layout=layout)
    save_track(tmp_path / "TRACK.csv", track)
    found = load_track(tmp_path / "TRACK.csv")
    assert replace(found, frames=()) == replace(track, frames=())
    for frame, given in zip(found.frames, track.frames, strict=True):
        assert_same_frame(frame, given, 1e-9)


def test_columns_are_those_of_the_design(tmp_path: Path, rng: np.random.Generator) -> None:
    track = random_track(rng)
    save_track(tmp_path / "a.csv", track)
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = list(rows[0])
    assert names[:10] == ["frame", "time", "status", "rms", "rx", "ry", "rz", "tx", "ty", "tz"]
    assert names[10:16] == [f"{r}.{e}" for r in ("mouth", "eyes") for e in LAYOUT.expressions]
    assert names[16:20] == ["units.jawOpen", "units.eyeBlinkLeft", "gaze.yaw", "gaze.pitch"]
    assert names[20:30] == [f"sd.{name}" for name in names[10:20]]
    assert names[30] == "seen"
    state = track.frames[2].state
    assert float(rows[2]["tz"]) == pytest.approx(state.t_cam_head[2], abs=1e-9)
    assert float(rows[2]["eyes.joy"]) == pytest.approx(state.weights[1, 1], abs=1e-9)
    assert rows[3]["status"] == "lost"
    assert not any(list(rows[3].values())[3:])
    assert json.loads((tmp_path / "a.json").read_text())["focal_px"] == 812.5


def test_rotation_vectors_go_on_smoothly_past_a_half_turn(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """A nodding head that faces the camera: R_cam_head turns by about pi about x."""
    state = random_state(rng)
    nods = [
        replace(state, R_cam_head=_about_x(angle)) for angle in np.pi + np.linspace(-0.3, 0.3, 9)
    ]
    save_track(tmp_path / "a.csv", track_of(nods, rng))
    with (tmp_path / "a.csv").open() as file:
        rx = [float(row["rx"]) for row in csv.DictReader(file)]
    np.testing.assert_allclose(rx, np.pi + np.linspace(-0.3, 0.3, 9), atol=1e-9)


def _about_x(angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])


def test_what_is_not_finite_is_an_empty_cell(tmp_path: Path, rng: np.random.Generator) -> None:
    frame = frame_of(0, 0.0, random_state(rng), rng)
    frame.deviations[3] = np.inf
    save_track(tmp_path / "a.csv", Track(LAYOUT, 8, 8, 9.0, 25.0, (frame,)))
    found = load_track(tmp_path / "a.csv").frames[0].deviations
    assert np.flatnonzero(np.isnan(found)).tolist() == [3]


def test_a_track_without_frames_round_trips(tmp_path: Path) -> None:
    track = Track(LAYOUT, 8, 8, 9.0, 25.0, ())
    save_track(tmp_path / "a.csv", track)
    assert load_track(tmp_path / "a.csv") == track


def written(tmp_path: Path, rng: np.random.Generator) -> Path:
    save_track(tmp_path / "a.csv", random_track(rng))
    return tmp_path / "a.csv"


def changed(path: Path, line: int, column: str, text: str) -> None:
    with path.open() as file:
        rows = list(csv.reader(file))
    rows[line - 1][columns_of(LAYOUT).index(column)] = text
    with path.open("w") as file:
        csv.writer(file).writerows(rows)


BAD_CELLS = [
    (1, "rms", "error", "line 1: expected a track, whose first line starts with frame,time,status"),
    (1, "ty", "y", "line 1: expected the column 'ty', found 'y'"),
    (2, "frame", "1.5", "line 2, frame: expected a whole number, found '1.5'"),
    (3, "frame", "0", "line 3, frame: expected a number above 0, found 0"),
    (3, "time", "1", "line 3, time: expected 2 s or later, found 1 s"),
    (3, "time", "", "line 3, time: expected a finite number, found ''"),
    (3, "status", "fine", "line 3, status: expected one of ok, reacquired, lost, found 'fine'"),
    (4, "rx", "nan", "line 4, rx: expected a finite number, found 'nan'"),
    (4, "gaze.yaw", "", "line 4, gaze.yaw: expected a finite number, found ''"),
    (4, "sd.eyes.joy", "x", "line 4, sd.eyes.joy: expected a finite number, found 'x'"),
    (4, "eyes.joy", "9", "line 4, eyes: expected weights that sum to 1, found"),
    (10, "time", "1e7", "line 10, time: expected at most 86400 s, found 1e+07 s"),
    (10, "time", "1e300", "line 10, time: expected a number from -1e+09 to 1e+09, found 1e300"),
    (10, "frame", "9" * 5000, "line 10, frame: expected a whole number, found '999"),
    (4, "rx", "1e300", "line 4, rx: expected a number from -1e+09 to 1e+09, found 1e300"),
    (4, "units.jawOpen", "50", "line 4, units.jawOpen: expected a weight from -0.5 to 1.5, found"),
    (4, "ty", "1_0", "line 4, ty: expected a finite number, found '1_0'"),
    (5, "tx", "3", "line 5, tx: expected an empty cell in a lost frame, found '3'"),
]


@pytest.mark.parametrize(("line", "column", "text", "message"), BAD_CELLS)
def test_bad_cells_are_named(
    tmp_path: Path, rng: np.random.Generator, line: int, column: str, text: str, message: str
) -> None:
    path = written(tmp_path, rng)
    changed(path, line, column, text)
    with pytest.raises(FileFormatError) as caught:
        load_track(path)
    assert str(caught.value).startswith(f"{path}: {message}")


def test_a_table_that_is_cut_off_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    path = written(tmp_path, rng)
    text = path.read_text()
    path.write_text(text[: text.rindex(",")])
    with pytest.raises(FileFormatError, match="line 10: expected 37 cells, found 36"):
        load_track(path)
    path.write_text(text.splitlines()[0].rsplit(",", 1)[0])
    with pytest.raises(FileFormatError, match="line 1: expected 37 columns, found 36"):
        load_track(path)


BAD_SIDECARS = [
    ({"version": 2}, "version: 2 was written by a newer mien (mien "),
    ({"format": "mien head"}, "format: expected 'mien track', found 'mien head'"),
    ({"fps": 0}, "fps: expected a number from 0.01 to 1000, found 0"),
    ({"fps": 1e9}, "fps: expected a number from 0.01 to 1000, found 1e+09"),
    ({"focal_px": 10**400}, "focal_px: expected a finite number"),
    ({"height": 10**30}, "height: expected a number above 0 and at most 65535, found 1e+30"),
    ({"width": 2.5}, "width: expected a whole number"),
    ({"units": ["jawOpen", "jawOpen"]}, "units: 'jawOpen' appears twice"),
    ({"units": None}, "units: expected a list, found null"),
    ({"expressions": ["joy"]}, "expressions: expected neutral first, found joy"),
]


@pytest.mark.parametrize(("change", "message"), BAD_SIDECARS)
def test_bad_sidecars_raise_one_line_errors(
    tmp_path: Path, rng: np.random.Generator, change: dict, message: str
) -> None:
    path = written(tmp_path, rng)
    sidecar = tmp_path / "a.json"
    sidecar.write_text(json.dumps(json.loads(sidecar.read_text()) | change))
    with pytest.raises(FileFormatError) as caught:
        load_track(path)
    assert str(caught.value).startswith(f"{sidecar}: {message}")


def test_a_missing_sidecar_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    path = written(tmp_path, rng)
    (tmp_path / "a.json").unlink()
    with pytest.raises(InputError, match=r"a\.json: expected the file that goes with the \.csv"):
        load_track(path)


def test_another_file_of_the_sidecars_name_is_kept(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    (tmp_path / "a.json").write_text('{"format": "mien timeline"}')
    for check in (check_track_place, lambda path: save_track(path, random_track(rng))):
        with pytest.raises(InputError, match=r"a\.json: expected no file of this name"):
            check(tmp_path / "a.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    with pytest.raises(InputError, match=r"a\.txt: expected a name that ends in \.csv"):
        check_track_place(tmp_path / "a.txt")
    written(tmp_path / "older", rng)
    check_track_place(tmp_path / "older" / "a.csv")


def test_tracks_are_known_by_their_first_line(tmp_path: Path, rng: np.random.Generator) -> None:
    assert is_track(written(tmp_path, rng))
    (tmp_path / "b.csv").write_text("Timecode,BlendShapeCount\n")
    assert not is_track(tmp_path / "b.csv")
    assert not is_track(tmp_path / "none.csv")


def test_frames_of_another_layout_are_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    frame = replace(frame_of(0, 0.0, random_state(rng), rng), deviations=np.zeros(3))
    with pytest.raises(InputError, match=r"deviations: expected shape \(10\)"):
        save_track(tmp_path / "a.csv", Track(LAYOUT, 8, 8, 9.0, 25.0, (frame,)))
    assert not list(tmp_path.iterdir())
