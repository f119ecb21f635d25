"""`mien track` as in a terminal: options, errors, a clip from start to end, live."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filmed import grey, written
from mien.arrays import Array
from mien.io.head.head_folder import load_head
from mien.io.tracks.track_csv import load_track
from mien.pipelines.track import Tracked
from mien.pipelines.tracking.live_loop import LiveSummary
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.render.picture import HeadRenderer
from mien.rig.state import FaceState
from mien.track.state import TrackedFrame
from packets import as_unreal_reads, listening, port_of
from terminal import Mien
from tracks import LAYOUT, frame_of, random_state

HEAD = ("--head", "anna")
FRAMES = 5
LENS = "560px"


@pytest.fixture(scope="module")
def clip(expressive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of the head that opens its mouth and turns."""
    renderer = HeadRenderer(load_head(expressive))
    frames = [
        renderer.draw(
            FaceState(units={"jawOpen": 0.1 * number}),
            renderer.camera(yaw=np.radians(2 * number), size=(240, 288)),
            background=(90, 110, 130),
        )[..., :3]
        for number in range(FRAMES)
    ]
    return written(tmp_path_factory.mktemp("clip") / "a.mp4", frames)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What was called with what, in the place of doing it."""
    calls: list[tuple[Any, ...]] = []

    def whole(*arguments: Any, progress: object, **options: Any) -> Tracked:
        calls.append((*arguments, options))
        counts = {"ok": 443, "reacquired": 2, "lost": 3}
        return Tracked(448, counts, 0, 31.24, 6.12, 800.0, ("a note",))

    def live(*arguments: Any, on_status: object, **options: Any) -> LiveSummary:
        calls.append((*arguments, options))
        return LiveSummary(300, 4, 3, 10.0, 29.9, 0.0412, ("another note",))

    monkeypatch.setattr("mien.pipelines.track.track_video", whole)
    monkeypatch.setattr("mien.pipelines.live.track_live_video", live)
    monkeypatch.setattr("mien.io.head.head_folder.load_head", lambda folder: f"head of {folder}")
    return calls


def test_a_video_and_its_table(mien: Mien, asked: list[tuple[Any, ...]]) -> None:
    ran = mien("track", "a.mp4", *HEAD, "-o", "t.csv")
    usual = {"lens": None, "smooth_seconds": None, "resume": False}
    assert asked == [("a.mp4", "head of anna", TrackFiles(Path("t.csv")), usual)]
    assert ran.status == 0
    expected = "448 frames, 2 found again, 3 lost, 31.2 frames/s, error 6.1 grey levels"
    assert ran.out == f"t.csv: {expected}\n"
    assert ran.err == "note: a note\n"


def test_all_options(mien: Mien, asked: list[tuple[Any, ...]]) -> None:
    places = ("--overlay", "o.mp4", "--plots", "p", "--live-link", "l.csv", "--openface", "f.csv")
    how = ("--lens", "28mm", "--smooth", "0.1", "--resume")
    mien("track", "a.mp4", *HEAD, "-o", "t.csv", *places, *how)
    files = TrackFiles(*map(Path, ("t.csv", "o.mp4", "p", "l.csv", "f.csv")))
    options = {"lens": "28mm", "smooth_seconds": 0.1, "resume": True}
    assert asked == [("a.mp4", "head of anna", files, options)]


def test_the_json_holds_everything(mien: Mien, asked: list[tuple[Any, ...]]) -> None:
    assert mien("track", "a.mp4", *HEAD, "-o", "t.csv", "--json").json == {
        "output": "t.csv",
        "frames": 448,
        "counts": {"ok": 443, "reacquired": 2, "lost": 3},
        "resumed": 0,
        "fps": 31.24,
        "rms": 6.12,
        "focal_px": 800.0,
        "notes": ["a note"],
    }


@pytest.mark.parametrize(
    ("arguments", "streams"),
    [
        (("0",), []),
        (("clip.mp4", "--live"), []),
        (("clip.mp4", "--stream", "vmc://"), ["vmc://"]),
        (("12", "--stream", "vmc://", "--stream", "livelink://a:1"), ["vmc://", "livelink://a:1"]),
    ],
)
def test_arguments_of_live_tracking(
    arguments: tuple[str, ...], streams: list[str], mien: Mien, asked: list[tuple[Any, ...]]
) -> None:
    ran = mien("track", *arguments, *HEAD)
    usual = {"lens": None, "lag": None, "seconds": None}
    assert asked == [(arguments[0], "head of anna", None, streams, usual)]
    expected = "300 frames, 29.9 a second, 4 lost, 3 pictures dropped"
    assert ran.out == f"{expected}, 41 ms from picture to packet\n"
    assert ran.err == "note: another note\n"


def test_a_live_run_that_is_kept(mien: Mien, asked: list[tuple[Any, ...]]) -> None:
    options = ("--lens", "60deg", "--smooth", "0.2", "--seconds", "9", "--openface", "f.csv")
    ran = mien("track", "0", *HEAD, "-o", "t.csv", *options, "--json")
    files = TrackFiles(Path("t.csv"), openface=Path("f.csv"))
    said = {"lens": "60deg", "lag": 0.2, "seconds": 9.0}
    assert asked == [("0", "head of anna", files, [], said)]
    assert ran.json["output"] == "t.csv"
    assert (ran.json["latency"], ran.json["notes"]) == (0.0412, ["another note"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.mp4", "-o", "t.csv"], "Missing option '--head'"),
        (["a.mp4", *HEAD], "-o: expected where the track goes, as -o track.csv, got nothing"),
        (["0", *HEAD, "--overlay", "o.mp4"], "--overlay: expected a video that is not tracked li"),
        (["0", *HEAD, "-o", "t.csv", "--plots", "p"], "--plots: expected a video that is not tra"),
        (["a.mp4", *HEAD, "--live", "--resume"], "--resume: expected a video that is not tracked"),
        (["0", *HEAD, "--openface", "f.csv"], "--openface: expected -o TRACK.csv beside it, got "),
        (["0", *HEAD, "--live-link", "f.csv"], "--live-link: expected -o TRACK.csv beside it, got"),
        (
            ["a.mp4", *HEAD, "-o", "t.csv", "--seconds", "3"],
            "--seconds: expected a camera, or a video with --live, got a.mp4",
        ),
        (
            ["a.mp4", *HEAD, "-o", "t.csv", "--smooth", "0"],
            "--smooth: expected a number of seconds above 0, got 0",
        ),
        (
            ["0", *HEAD, "--seconds", "nan"],
            "--seconds: expected a number of seconds above 0, got n",
        ),
        (
            ["0", *HEAD, "--seconds", "inf"],
            "--seconds: expected a number of seconds above 0, got i",
        ),
        (["0", *HEAD, "--smooth", "slow"], "Invalid value for '--smooth'"),
    ],
)
def test_options_that_exclude_each_other(arguments: list[str], message: str, mien: Mien) -> None:
    assert mien("track", *arguments).error.startswith(message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.mp4", "--head", "nowhere", "-o", "t.csv"], "nowhere: expected a head folder that"),
        (["no.mp4", "-o", "t.csv"], "no.mp4: expected a video, got no such file"),
        (["a.txt", "-o", "t.csv"], "a.txt: expected a video, found a text file"),
        (["a.mp4", "-o", "t.txt"], "t.txt: expected a name that ends in .csv, got .txt"),
        (["a.mp4", "-o", "t.csv", "--overlay", "o.avi"], "o.avi: expected a name that ends in"),
        (["a.mp4", "-o", "t.csv", "--lens", "wide"], "lens: expected a number with its unit"),
        (["no.mp4", "--live"], "no.mp4: expected a video, got no such file"),
        (["99"], "camera 99: expected a camera that is connected"),
        (["a.mp4", "--stream", "http://a"], "--stream: expected livelink://HOST:PORT or vmc://"),
        (["a.mp4", "--live", "--lens", "0px"], "lens: expected more than 0, and less than 180deg"),
    ],
)
def test_inputs_that_cannot_be_tracked(
    arguments: list[str],
    message: str,
    mien: Mien,
    expressive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written(tmp_path / "a.mp4", grey([40, 60]))
    (tmp_path / "a.txt").write_text("no video")
    monkeypatch.chdir(tmp_path)
    head = () if "--head" in arguments else ("--head", expressive)
    error = mien("track", *arguments, *head).error
    assert error.startswith(message)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "a.txt"]


def test_from_start_to_end(clip: Path, expressive: Path, mien: Mien, tmp_path: Path) -> None:
    table, overlay, plots = (tmp_path / name for name in ("t.csv", "o.mp4", "plots"))
    places = ("-o", table, "--overlay", overlay, "--plots", plots)
    ran = mien("track", clip, "--head", expressive, *places, "--json")
    assert ran.json["counts"] == {"ok": FRAMES, "reacquired": 0, "lost": 0}
    assert ran.json["rms"] < 12
    assert any(re.match(r"focal length \d+ px", note) for note in ran.json["notes"])
    found = load_track(table)
    assert [frame.status for frame in found.frames] == ["ok"] * FRAMES
    assert found.focal_px == ran.json["focal_px"]
    assert found.layout.expressions == ("neutral", "joy", "anger")
    assert (plots / "index.html").exists()
    import av

    with av.open(overlay) as container:
        assert len(list(container.decode(video=0))) == FRAMES


class Counting:
    """Finds another head in every frame, the same ones in every run."""

    layout = LAYOUT
    other_faces_seen = False
    stops_at: int | None = None

    def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
        if frame == self.stops_at:
            raise KeyboardInterrupt
        rng = np.random.default_rng(frame)
        return frame_of(frame, time, random_state(rng), rng)

    def resume(self, frames: Sequence[TrackedFrame]) -> None: ...


def test_stopped_and_resumed(
    clip: Path, expressive: Path, mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker = Counting()
    monkeypatch.setattr(PreparedHead, "tracker", lambda prepared, *size: tracker)
    command = ("track", clip, "--head", expressive, "--lens", LENS, "-o")
    assert mien(*command, tmp_path / "whole.csv").status == 0
    tracker.stops_at = 3
    stopped = mien(*command, tmp_path / "t.csv")
    assert (stopped.status, stopped.out) == (130, "")
    assert "note: stopped; with --resume it goes on from here" in stopped.err
    assert not (tmp_path / "t.csv").exists()
    tracker.stops_at = None
    resumed = mien(*command, tmp_path / "t.csv", "--resume")
    assert f"t.csv: {FRAMES} frames, 3 from before, " in resumed.out
    assert (tmp_path / "t.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


def test_live_from_a_file_to_a_receiver(
    clip: Path, expressive: Path, mien: Mien, tmp_path: Path
) -> None:
    table = tmp_path / "t.csv"
    with listening() as unreal:
        stream = f"livelink://127.0.0.1:{port_of(unreal)}/anna"
        ran = mien("track", clip, "--head", expressive, "--stream", stream, "-o", table, "--json")
        _, subject, _, values = as_unreal_reads(unreal.recv(2048))
    assert subject == "anna"
    assert abs(values["HeadYaw"]) < np.radians(5)
    found = load_track(table)
    assert ran.json["frames"] == len(found.frames) == FRAMES - ran.json["dropped"]
    assert found.frames[0].status == "ok", "what it was warmed up with is forgotten"
    assert {frame.status for frame in found.frames} <= {"ok", "reacquired"}
