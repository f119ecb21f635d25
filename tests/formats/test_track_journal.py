"""Journals of unfinished runs: every frame comes back bit for bit, whenever the run was killed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mien.errors import FileFormatError, InputError
from mien.formats.track_journal import FLUSH_SECONDS, Journal, journal_of, load_journal
from mien.track.state import TrackedFrame, TrackState
from tracks import random_track

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
    odd = replace(frames[0].state, weights=np.zeros((0, 3)), units=np.array([-0.0, 5e-324]))
    return [replace(frames[0], state=odd, time=np.float64(1 / 3)), *frames[1:]]


def kept(path: Path, frames: list[TrackedFrame]) -> Path:
    with Journal.start(path, HEADER) as journal:
        for frame in frames:
            journal.append(frame)
    return path


def test_frames_come_back_bit_for_bit(tmp_path: Path, rng: np.random.Generator) -> None:
    frames = frames_of(rng)
    found = load_journal(kept(tmp_path / "a.csv.part", frames), HEADER)
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
        assert len(load_journal(path, HEADER)) == sum(end < cut for end in ends) - 1


def test_a_run_goes_on_where_it_was_killed(tmp_path: Path, rng: np.random.Generator) -> None:
    frames = frames_of(rng)
    path = kept(tmp_path / "a.part", frames[:5])
    whole = path.read_bytes()
    path.write_bytes(whole[:-10])
    found = load_journal(path, HEADER)
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
    assert load_journal(path, HEADER) == ()
    now += FLUSH_SECONDS
    journal.append(frames_of(rng)[3])
    assert len(load_journal(path, HEADER)) == 4
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
    assert len(load_journal(path, HEADER)) == 1


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
        load_journal(path, HEADER | change)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_bad_files_are_told_in_one_line(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "a.part"
    with pytest.raises(InputError, match="expected a readable file"):
        load_journal(path, HEADER)
    for content in ("", "[]\n", "frame,time\n", '{"format": "mien tr'):
        path.write_text(content)
        with pytest.raises(FileFormatError, match="expected the journal of an unfinished track"):
            load_journal(path, HEADER)
    kept(path, frames_of(rng)[:3])
    lines = path.read_text().splitlines()
    for broken in ('{"frame": 1}', "\xff\0", lines[2].replace("R_cam_head", "R"), "3"):
        path.write_text("\n".join([*lines[:2], broken, *lines[3:], ""]))
        with pytest.raises(FileFormatError, match="line 3: expected a frame of a track, found"):
            load_journal(path, HEADER)
    path.write_text(json.dumps(json.loads(lines[0]) | {"version": 2}) + "\n")
    with pytest.raises(FileFormatError, match="version: 2 was written by a newer mien"):
        load_journal(path, HEADER)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(InputError, match="expected a place that can be written to"):
        Journal.start(tmp_path / "a" / "b.part", HEADER)
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no device that is always full")
    journal = Journal(full, full.open("w"), iter(range(9)).__next__)
    for step in (lambda: journal.append(frames_of(rng)[0]), journal.close):
        with pytest.raises(InputError, match="No space left on device"):
            step()
