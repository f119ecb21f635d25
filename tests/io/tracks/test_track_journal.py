"""Journals of unfinished runs: every frame comes back bit for bit, whenever the run was killed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from documents import put
from mien.errors import FileFormatError, InputError
from mien.io.tracks.track_journal import FLUSH_SECONDS, Journal, journal_of, load_journal
from mien.track.state import TrackedFrame, TrackState
from tracks import LAYOUT, random_track

HEADER = {"video": {"name": "a.mp4", "bytes": 1000}, "size": (640, 360), "focal_px": 812.5}


def bits(value: object) -> bytes:
    return np.asarray(value, dtype=np.float64).tobytes()


def assert_same_bits(found: TrackedFrame, given: TrackedFrame) -> None:
    assert (found.frame, found.status) == (given.frame, given.status)
    for name in ("time", "rms", "seen", "deviations", "gain", "bias"):
        assert bits(getattr(found, name)) == bits(getattr(given, name)), name
    assert (found.state is None) == (given.state is None)
    for name in TrackState.__dataclass_fields__ if given.state else ():
        assert getattr(found.state, name).shape == getattr(given.state, name).shape
        assert bits(getattr(found.state, name)) == bits(getattr(given.state, name)), name


def frames_of(rng: np.random.Generator) -> list[TrackedFrame]:
    frames = list(random_track(rng).frames)
    odd = replace(frames[0].state, units=np.array([-0.0, 5e-324]))
    return [replace(frames[0], state=odd, time=np.float64(1 / 3)), *frames[1:]]


def kept(path: Path, frames: list[TrackedFrame]) -> Path:
    with Journal.start(path, HEADER) as journal:
        for frame in frames:
            journal.append(frame)
    return path


def test_frames_round_trip_bit_for_bit(tmp_path: Path, rng: np.random.Generator) -> None:
    frames = frames_of(rng)
    found = load_journal(kept(tmp_path / "a.csv.part", frames), HEADER, LAYOUT)
    for frame, given in zip(found, frames, strict=True):
        assert_same_bits(frame, given)


def test_a_run_killed_at_any_byte_loses_only_the_line_it_was_at(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    frames = frames_of(rng)[:4]
    path = kept(tmp_path / "a.part", frames)
    whole = path.read_bytes()
    ends = [index for index, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(ends[0] + 1, len(whole), 37):
        path.write_bytes(whole[:cut])
        assert len(load_journal(path, HEADER, LAYOUT)) == sum(end < cut for end in ends) - 1


def test_a_run_goes_on_where_it_was_killed(tmp_path: Path, rng: np.random.Generator) -> None:
    frames = frames_of(rng)
    path = kept(tmp_path / "a.part", frames[:5])
    whole = path.read_bytes()
    path.write_bytes(whole[:-10])
    found = load_journal(path, HEADER, LAYOUT)
    with Journal.start(path, HEADER, found) as journal:
        for frame in frames[len(found) :]:
            journal.append(frame)
    assert path.read_bytes() == kept(tmp_path / "b.part", frames).read_bytes()


def test_frames_reach_the_disk_in_time(tmp_path: Path, rng: np.random.Generator) -> None:
    now = 0.0
    path = tmp_path / "a.part"
    journal = Journal.start(path, HEADER, clock=lambda: now)
    for frame in frames_of(rng)[:3]:
        journal.append(frame)
    assert load_journal(path, HEADER, LAYOUT) == ()
    now += FLUSH_SECONDS
    journal.append(frames_of(rng)[3])
    assert len(load_journal(path, HEADER, LAYOUT)) == 4
    journal.remove()
    assert not path.exists()


def test_a_run_that_fails_keeps_its_journal(tmp_path: Path, rng: np.random.Generator) -> None:
    path = journal_of(tmp_path / "TRACK.csv")
    assert path.name == "TRACK.csv.part"

    def fail_half_way() -> None:
        with Journal.start(path, HEADER) as journal:
            journal.append(frames_of(rng)[0])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail_half_way()
    assert len(load_journal(path, HEADER, LAYOUT)) == 1


OTHERS = [
    ({"focal_px": 900.0}, "expected an unfinished run with focal_px = 900.0, got one with 812.5"),
    ({"size": (640, 480)}, "with size = [640, 480], got one with [640, 360]"),
    ({"video": {"name": "b.mp4", "bytes": 1}}, 'with video.name = "b.mp4", got one with "a.mp4"'),
    ({"lens": 3}, "with lens = 3, got one with null"),
]


@pytest.mark.parametrize(("change", "message"), OTHERS)
def test_another_runs_journal_is_refused(tmp_path: Path, change: dict, message: str) -> None:
    path = kept(tmp_path / "a.part", [])
    with pytest.raises(InputError) as caught:
        load_journal(path, HEADER | change, LAYOUT)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_bad_files_raise_one_line_errors(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "a.part"
    with pytest.raises(InputError, match="expected a readable file"):
        load_journal(path, HEADER, LAYOUT)
    for content in ("", "[]\n", '{"format": "mien tr'):
        path.write_text(content)
        with pytest.raises(FileFormatError, match="expected the journal of an unfinished track"):
            load_journal(path, HEADER, LAYOUT)
    for content, problem in (
        ("frame,time\n", "line 1, column 1: expected JSON"),
        ("[" * 100_000 + "\n", "line 1: expected lists and objects at most 64 deep"),
    ):
        path.write_text(content)
        with pytest.raises(FileFormatError, match=problem):
            load_journal(path, HEADER, LAYOUT)
    kept(path, frames_of(rng)[:3])
    lines = path.read_text().splitlines()
    path.write_text(json.dumps(json.loads(lines[0]) | {"version": 2}) + "\n")
    with pytest.raises(FileFormatError, match="line 1, version: 2 was written by a newer mien"):
        load_journal(path, HEADER, LAYOUT)


STATE = ("state",)
BROKEN = [
    (put("frame", to="x"), "frame: expected a whole number, found text 'x'"),
    (put("frame", to=2), "frame: expected 1, found 2"),
    (put("frame", to=0), "frame: expected 1, found 0"),
    (put("time", to=1.5), "time: expected 2 s or later, found 1.5 s"),
    (put("time", to=float("nan")), "time: expected a finite number, found nan"),
    (put("status", to="fine"), "status: unknown status 'fine'"),
    (put("status", to="lost"), "state: expected none of a frame that is lost"),
    (put("state", to=None), "state: expected one of a frame that is ok"),
    (put("state", to=[]), "state: expected an object, found a list"),
    (put("rms", to=float("nan")), "rms[0]: expected a finite number, found nan"),
    (put("gain", to=[1, 1]), "gain: expected 3 numbers, found 2"),
    (put("gain", 1, to=float("inf")), "gain[1]: expected a finite number, found inf"),
    (put("deviations", to=[0.1]), "deviations: expected 10 numbers, found 1"),
    (put("deviations", 3, to="x"), "deviations[3]: expected a number, found text 'x'"),
    (put("more", to=1), "more: unknown key 'more'"),
    (put(*STATE, "units", to=[0, 0, 0]), "state.units: expected 2 numbers, found 3"),
    (put(*STATE, "units", to={}), "state.units: expected a list, found an object"),
    (put(*STATE, "weights", to=[]), "state.weights: expected 6 numbers, found 0"),
    (put(*STATE, "weights_shape", to=[3, 2]), "state.weights_shape: expected [2, 3], found [3, 2]"),
    (put(*STATE, "gaze", 0, to=1e300), "state.gaze[0]: expected a number from -1e+09 to 1e+09"),
    (put(*STATE, "R_cam_head", to=[0] * 9), "R_cam_head: expected a rotation matrix, found one"),
    (put(*STATE, "R", to=[0] * 9), "state.R: unknown key 'R'; "),
]


@pytest.mark.parametrize(("change", "problem"), BROKEN, ids=[problem for _, problem in BROKEN])
def test_a_broken_line_is_named(
    tmp_path: Path, rng: np.random.Generator, change: Callable[[Any], None], problem: str
) -> None:
    path = kept(tmp_path / "a.part", list(random_track(rng).frames[:3]))
    lines = path.read_text().splitlines()
    data = json.loads(lines[2])
    change(data)
    path.write_text("\n".join([*lines[:2], json.dumps(data), *lines[3:], ""]))
    with pytest.raises(FileFormatError) as caught:
        load_journal(path, HEADER, LAYOUT)
    assert str(caught.value).startswith(f"{path}: line 3, {problem}")


def test_lines_that_are_dropped_doubled_or_no_frames_are_named(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    path = kept(tmp_path / "a.part", list(random_track(rng).frames))
    lines = path.read_text().splitlines()
    for changed, problem in (
        ([*lines[:4], *lines[5:]], "line 5, frame: expected 3, found 4"),
        ([*lines[:4], *lines[3:]], "line 5, frame: expected 3, found 2"),
        ([*lines[:3], lines[4], lines[3], *lines[5:]], "line 4, frame: expected 2, found 3"),
        ([*lines[:4], "\udcff", *lines[5:]], "line 5: expected a frame of a track, found"),
        ([*lines[:4], "3", *lines[5:]], "line 5: expected a frame of a track, found '3"),
        ([*lines[:4], "[" * 100_000, *lines[5:]], "line 5: expected lists and objects at most 64"),
        ([*lines[:4], lines[4][:50], *lines[5:]], "line 5, column "),
        ([*lines[:4], "", *lines[4:]], "line 5, column 1: expected JSON"),
    ):
        text = "\n".join([*changed, ""])
        path.write_bytes(text.encode("utf-8", errors="surrogateescape"))
        with pytest.raises(FileFormatError) as caught:
            load_journal(path, HEADER, LAYOUT)
        assert str(caught.value).startswith(f"{path}: {problem}")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(InputError, match="expected a place that can be written to"):
        Journal.start(tmp_path / "a" / "b.part", HEADER, LAYOUT)
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no device that is always full")
    journal = Journal(full, full.open("w"), iter(range(9)).__next__)
    for step in (lambda: journal.append(frames_of(rng)[0]), journal.close):
        with pytest.raises(InputError, match="No space left on device"):
            step()
