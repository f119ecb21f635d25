"""The way of `mien track`, with a tracker that sees brightness but remembers as a real one."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mien.pipelines.track
import mien.pipelines.tracking.run
from filmed import broken, grey, written
from mien.arrays import Array
from mien.camera import FRONTAL
from mien.errors import EstimationError, FileFormatError, InputError, MienError
from mien.io.tracks.track_csv import load_track
from mien.io.tracks.track_journal import journal_of
from mien.pipelines.track import FRAME_STAGES, STARTED_OVER, Tracked, track_video
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.track.state import Layout, Status, TrackedFrame, TrackState
from posable import head, head_of

LAYOUT = Layout(("mouth",), ("neutral", "joy"), ("jawOpen",))
BLACK = 30
"""Darker pictures show no face."""


class BrightnessTracker:
    """Finds heads as far away as pictures are bright, and as they were before."""

    layout = LAYOUT
    stops_at: int | None = None
    made = 0
    other_faces_seen = False

    def __init__(self, *arguments: object, **options: object) -> None:
        type(self).made += 1
        self.past: list[TrackedFrame] = []

    def resume(self, frames: Sequence[TrackedFrame]) -> None:
        self.past = list(frames[-2:])

    def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
        if frame == self.stops_at:
            raise KeyboardInterrupt
        level = float(pixels.mean())
        status: Status = "lost" if level < BLACK else "ok"
        if status == "ok" and self.past and self.past[-1].state is None:
            status = "reacquired"
        found = TrackedFrame(
            frame=frame,
            time=time,
            status=status,
            state=None if status == "lost" else self._state(level / 255),
            rms=level / 20 if level >= BLACK else np.nan,
            seen=1.0,
            deviations=np.full(len(LAYOUT.channels), 0.1),
            gain=np.ones(3),
            bias=np.zeros(3),
        )
        self.past = [*self.past[-1:], found]
        return found

    def _state(self, share: float) -> TrackState:
        before = [past.state.values for past in self.past if past.state is not None]
        share = float(share / 3 + sum(values[1] for values in before) / 3)
        return TrackState(
            R_cam_head=FRONTAL,
            t_cam_head=np.array([0.0, 0.0, 500 + 300 * share]),
            weights=np.array([[1 - share, share]]),
            units=np.array([share]),
            gaze=np.array([share, -share]),
        )


@pytest.fixture(autouse=True)
def tracker(monkeypatch: pytest.MonkeyPatch) -> type[BrightnessTracker]:
    """In the place of the real one; no detector, and a lens that is known."""

    class Fresh(BrightnessTracker):
        pass

    class Nobody:
        def __enter__(self) -> None:
            return None

        def __exit__(self, *error: object) -> None:
            return None

    monkeypatch.setattr(PreparedHead, "tracker", Fresh)
    monkeypatch.setattr(mien.pipelines.track, "LandmarkDetector", Nobody)
    monkeypatch.setattr(mien.pipelines.track, "turn_upright", lambda *rest: False)
    monkeypatch.setattr(mien.pipelines.track, "find_focal", lambda *rest: (100.0, "of the lens"))
    return Fresh


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Twelve frames, of which two are dark."""
    return written(tmp_path / "a.mp4", grey([40, 60, 80, 100, 120, 5, 5, 140, 160, 180, 200, 220]))


def track(video: Path, table: Path, **options: Any) -> Tracked:
    return track_video(video, head(), TrackFiles(table), **options)


def everything(place: Path) -> TrackFiles:
    """All that can be written; the table in a folder that is not there yet."""
    return TrackFiles(*(place / name for name in ("new/t.csv", "o.mp4", "plots", "l.csv", "f.csv")))


def results(table: Path) -> tuple[bytes, bytes]:
    return table.read_bytes(), table.with_suffix(".json").read_bytes()


def test_a_table_of_all_frames(clip: Path, tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    tracked = track(clip, tmp_path / "t.csv", progress=lambda *step: told.append(step))
    assert tracked.counts == {"ok": 9, "reacquired": 1, "lost": 2}
    assert (tracked.frames, tracked.resumed, tracked.focal_px) == (12, 0, 100)
    assert tracked.fps is not None
    assert tracked.fps > 0
    assert tracked.rms == pytest.approx(6.5, abs=0.15)
    assert tracked.notes == ("of the lens", "the face is lost in 2 of 12 frames, at 0.50 s first")
    assert told == [("Tracking", done, 12) for done in range(13)]
    found = load_track(tmp_path / "t.csv")
    assert (found.layout, found.width, found.height, found.fps) == (LAYOUT, 64, 48, 10)
    assert [frame.frame for frame in found.frames] == list(range(12))
    assert [frame.time for frame in found.frames] == pytest.approx(np.arange(12) / 10)
    assert [frame.status for frame in found.frames][5:8] == ["lost", "lost", "reacquired"]
    assert not journal_of(tmp_path / "t.csv").exists()


@pytest.mark.parametrize(
    ("tracked", "text"),
    [
        (
            Tracked(448, {"ok": 443, "reacquired": 2, "lost": 3}, 100, 31.24, 6.12, 800),
            "448 frames, 100 from before, 2 found again, 3 lost, 31.2 frames/s, "
            "error 6.1 grey levels",
        ),
        (Tracked(2, {"ok": 0, "reacquired": 0, "lost": 2}, 0, None, None, 800), "2 frames, 2 lost"),
    ],
)
def test_text_of_the_summary(tracked: Tracked, text: str) -> None:
    assert str(tracked) == text


@pytest.mark.parametrize("stops_at", [0, 1, 2, 6, 7, 11])
def test_stopped_and_resumed_gives_the_same_files(
    clip: Path, tmp_path: Path, tracker: type[BrightnessTracker], stops_at: int
) -> None:
    track(clip, tmp_path / "whole.csv", smooth_seconds=0.1)
    tracker.stops_at = stops_at
    with pytest.raises(KeyboardInterrupt):
        track(clip, tmp_path / "t.csv", smooth_seconds=0.1)
    assert journal_of(tmp_path / "t.csv").exists()
    assert not (tmp_path / "t.csv").exists()
    tracker.stops_at = None
    told: list[tuple[str, int, int]] = []
    tracked = track(
        clip,
        tmp_path / "t.csv",
        smooth_seconds=0.1,
        resume=True,
        progress=lambda *step: told.append(step),
    )
    assert tracked.resumed == stops_at
    assert told == [("Tracking", done, 12) for done in range(stops_at, 13)]
    assert results(tmp_path / "t.csv") == results(tmp_path / "whole.csv")
    assert not journal_of(tmp_path / "t.csv").exists()


@pytest.mark.parametrize("lost", [1, 200, 700])
def test_killed_while_it_wrote(
    clip: Path, tmp_path: Path, tracker: type[BrightnessTracker], lost: int
) -> None:
    track(clip, tmp_path / "whole.csv")
    tracker.stops_at = 8
    with pytest.raises(KeyboardInterrupt):
        track(clip, tmp_path / "t.csv")
    journal = journal_of(tmp_path / "t.csv")
    journal.write_bytes(journal.read_bytes()[:-lost])
    tracker.stops_at = None
    assert track(clip, tmp_path / "t.csv", resume=True).resumed < 8
    assert results(tmp_path / "t.csv") == results(tmp_path / "whole.csv")


def test_stopped_while_it_drew(
    clip: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    files = TrackFiles(tmp_path / "t.csv", overlay=tmp_path / "o.mp4")

    def stop(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("mien.report.track.overlay.save_overlay", stop)
        with pytest.raises(KeyboardInterrupt):
            track_video(clip, head(), files)
    tracked = track_video(clip, head(), files, resume=True)
    assert (tracked.resumed, tracked.fps) == (12, None)
    assert (tmp_path / "o.mp4").exists()


def test_started_over(clip: Path, tmp_path: Path, tracker: type[BrightnessTracker]) -> None:
    tracker.stops_at = 5
    with pytest.raises(KeyboardInterrupt):
        track(clip, tmp_path / "t.csv")
    tracker.stops_at = None
    tracked = track(clip, tmp_path / "t.csv")
    assert tracked.resumed == 0
    assert tracked.notes[0] == STARTED_OVER
    assert track(clip, tmp_path / "t.csv", resume=True).resumed == 0, "nothing is left of it"


def test_another_run_is_not_resumed(
    clip: Path, tmp_path: Path, tracker: type[BrightnessTracker]
) -> None:
    tracker.stops_at = 5
    with pytest.raises(KeyboardInterrupt):
        track(clip, tmp_path / "t.csv")
    before = journal_of(tmp_path / "t.csv").read_bytes()
    with pytest.raises(InputError, match=r"t\.csv\.part: .* focal_px = 200"):
        track(clip, tmp_path / "t.csv", lens="200px", resume=True)
    other = head_of(expressions={"neutral": replace(head().expressions["neutral"])})
    with pytest.raises(InputError, match=r"with head = "):
        track_video(clip, other, TrackFiles(tmp_path / "t.csv"), resume=True)
    video = written(tmp_path / "b.mp4", grey([200, 100]))
    with pytest.raises(InputError, match=r"with video\.name = .*b\.mp4"):
        track(video, tmp_path / "t.csv", resume=True)
    assert journal_of(tmp_path / "t.csv").read_bytes() == before


def test_times_of_a_variable_rate(tmp_path: Path) -> None:
    times = [0, 1, 2, 6, 7, 11]
    track(written(tmp_path / "a.mp4", grey([40] * 6), times), tmp_path / "t.csv")
    found = load_track(tmp_path / "t.csv")
    assert [frame.time for frame in found.frames] == pytest.approx(np.array(times) / 10)
    assert found.fps == pytest.approx(5 / 1.1)


def test_a_clock_that_jumps_back(tmp_path: Path) -> None:
    parts = [written(tmp_path / name, grey([40, 50, 60])) for name in ("a.mts", "b.mts")]
    joined = tmp_path / "joined.mts"
    joined.write_bytes(b"".join(part.read_bytes() for part in parts))
    assert track(joined, tmp_path / "t.csv").frames == 6
    times = [frame.time for frame in load_track(tmp_path / "t.csv").frames]
    assert times == sorted(times)


def test_a_stream_that_breaks_keeps_what_was_tracked(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    noise = rng.integers(0, 256, (40, 48, 64, 3), dtype=np.uint8)
    tracked = track(broken(written(tmp_path / "a.mkv", noise)), tmp_path / "t.csv")
    assert 10 < tracked.frames < 30
    assert len(load_track(tmp_path / "t.csv").frames) == tracked.frames
    assert "of the 40 frames" in tracked.notes[-1] or "the stream breaks" in tracked.notes[-1]


def test_one_frame(tmp_path: Path) -> None:
    files = everything(tmp_path)
    assert track_video(written(tmp_path / "a.mp4", grey([90])), head(), files).frames == 1
    assert len(load_track(files.table).frames) == 1
    assert len((tmp_path / "l.csv").read_text().splitlines()) == 2


def test_clip_without_a_face(tmp_path: Path) -> None:
    files = everything(tmp_path)
    clip = written(tmp_path / "a.mp4", grey([5] * 4))
    told = f"{clip}: expected the head's face, found in none of 4 frames: no face was there; "
    with pytest.raises(EstimationError) as caught:
        track_video(clip, head(), files)
    assert str(caught.value) == f"{told}{files.table} says so of each"
    assert not journal_of(files.table).exists()
    assert [frame.state for frame in load_track(files.table).frames] == [None] * 4
    assert (tmp_path / "o.mp4").exists()
    assert not (tmp_path / "l.csv").exists()


def test_all_that_can_be_written(clip: Path, tmp_path: Path) -> None:
    files = everything(tmp_path)
    told: list[str] = []
    track_video(clip, head(), files, progress=lambda stage, done, total: told.append(stage))
    assert list(dict.fromkeys(told)) == ["Tracking", "Drawing the overlay", "Drawing plots"]
    assert set(told) - set(FRAME_STAGES) == {"Drawing plots"}
    assert (tmp_path / "plots" / "index.html").exists()
    for name in ("l.csv", "f.csv"):
        assert len((tmp_path / name).read_text().splitlines()) == 13
    import av

    with av.open(tmp_path / "o.mp4") as container:
        assert len(list(container.decode(video=0))) == 12


def test_memory_holds_no_pictures(tmp_path: Path) -> None:
    """Two hundred frames more take what their numbers take."""
    peaks = []
    for count in (20, 220):
        clip = written(tmp_path / f"{count}.mp4", grey([100] * count))
        tracemalloc.start()
        track(clip, tmp_path / "t.csv")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    picture = 48 * 64 * 3
    assert peaks[1] - peaks[0] < 200 * picture / 3


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"table": "t"}, r"t: expected a name that ends in \.csv, got no suffix"),
        ({"table": "t.txt"}, r"t\.txt: expected a name that ends in \.csv, got \.txt"),
        ({"table": "folder.csv"}, r"folder\.csv: expected a file's name, got a folder"),
        ({"table": "a.mp4/t.csv"}, r"t\.csv: expected a place that can be written to, got"),
        ({"overlay": "o.avi"}, r"o\.avi: expected a name that ends in \.mp4 or \.webm"),
        ({"overlay": "folder.mp4"}, r"folder\.mp4: expected a file's name, got a folder"),
        ({"plots": "a.txt"}, r"index\.html: expected a place that can be written to, got"),
        ({"live_link": "folder.csv"}, r"folder\.csv: expected a file's name, got a folder"),
        ({"openface": "t.csv"}, r"t\.csv: expected another name than that of the table, got the"),
        ({"live_link": "a.mp4"}, r"a\.mp4: expected another name than that of the video, got the"),
    ],
)
def test_places_are_checked_before_the_work(
    files: dict[str, str],
    message: str,
    clip: Path,
    tmp_path: Path,
    tracker: type[BrightnessTracker],
    contents: Callable[[Path], dict[str, bytes]],
) -> None:
    for name in ("folder.csv", "folder.mp4"):
        (tmp_path / name).mkdir()
    (tmp_path / "a.txt").touch()
    before = contents(tmp_path)
    paths = {name: tmp_path / path for name, path in ({"table": "t.csv"} | files).items()}
    with pytest.raises(InputError, match=message):
        track_video(clip, head(), TrackFiles(**paths))
    assert tracker.made == 0
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lens": "wide"}, "lens: expected a number with its unit"),
        ({"smooth_seconds": 0.0}, "smooth_seconds: expected a number above zero"),
    ],
)
def test_bad_options(
    options: dict[str, Any],
    message: str,
    clip: Path,
    tmp_path: Path,
    tracker: type[BrightnessTracker],
) -> None:
    with pytest.raises(InputError, match=message):
        track(clip, tmp_path / "t.csv", **options)
    assert tracker.made == 0


def test_files_that_are_no_video(tmp_path: Path, tracker: type[BrightnessTracker]) -> None:
    cases: list[tuple[str, type[MienError], str]] = [
        ("missing.mp4", InputError, r"missing\.mp4: expected a video, got no such file"),
        ("text.mp4", FileFormatError, r"text\.mp4: expected a video, found a text file"),
    ]
    (tmp_path / "text.mp4").write_text("no video")
    for name, kind, message in cases:
        with pytest.raises(kind, match=message):
            track(tmp_path / name, tmp_path / "t.csv")
    assert tracker.made == 0
    assert not journal_of(tmp_path / "t.csv").exists()
