"""`mien animate`: every kind of file, and what is refused before any work is done."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from glb_file import Glb
from mien.animate.perform import frame_times
from mien.animate.timeline import Timeline
from mien.arrays import Array
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.io.timeline.timeline_file import load_timeline
from mien.pipelines.animate import AnimationResult, animate_head
from mien.render.picture import HeadRenderer
from terminal import Mien

Contents = Callable[[Path], dict[str, bytes]]
SIZE = (96, 120)
TRACKS = {
    "head": {"yaw": [[0, 0], [0.5, 20]]},
    "gaze": {"yaw": [[0, 0], [0.5, 15]]},
    "units": {"jawOpen": [[0, 0], [0.5, 0.6]], "eyeBlinkLeft": [[0, 1], [0.5, 0]]},
}


def written(place: Path, tracks: dict[str, Any] = TRACKS, **changed: Any) -> Path:
    """A timeline of half a second, ten frames a second."""
    document = {"format": "mien timeline", "version": 1, "duration": 0.5, "fps": 10}
    path = place / "take.json"
    path.write_text(json.dumps(document | {"size": SIZE, "tracks": tracks} | changed))
    return path


def frames_in(path: Path, codec: str | None = None) -> Iterator[Any]:
    import av

    with av.open(path) as container:
        stream = container.streams.video[0]
        if codec is None:
            yield from container.decode(stream)
            return
        decoder = av.CodecContext.create(codec, "r")
        for packet in container.demux(stream):
            yield from decoder.decode(packet)


@pytest.fixture
def timeline(tmp_path: Path) -> Path:
    return written(tmp_path)


def test_a_video_by_the_timelines_own_size_and_rate(
    expressive: Path, timeline: Path, mien: Mien, tmp_path: Path
) -> None:
    import av

    out = tmp_path / "a.mp4"
    ran = mien("animate", timeline, "--head", expressive, "-o", out, "--json")
    assert ran.json == {"output": str(out), "frames": 5, "notes": []}
    with av.open(out) as container:
        assert container.streams.video[0].average_rate == 10
        pictures = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
    assert [picture.shape for picture in pictures] == [(120, 96, 3)] * 5
    np.testing.assert_allclose(pictures[0][0, 0], (72, 74, 84), atol=4)
    assert np.abs(pictures[0].astype(int) - pictures[4]).max() > 40


def test_what_is_asked_for_wins(
    expressive: Path, timeline: Path, mien: Mien, tmp_path: Path
) -> None:
    out = tmp_path / "a.mp4"
    options = ("--fps", 20, "--size", "64x80", "--background", "#ffffff", "--yaw", 180)
    ran = mien("animate", timeline, "--head", expressive, "-o", out, *options)
    assert ran.out == f"{out}: 10 frames\n"
    assert "Animating" in ran.err
    pictures = [frame.to_ndarray(format="rgb24") for frame in frames_in(out)]
    assert [picture.shape for picture in pictures] == [(80, 64, 3)] * 10
    assert pictures[0][0, 0].min() > 250


def test_a_webm_has_alpha(expressive: Path, timeline: Path, mien: Mien, tmp_path: Path) -> None:
    import av

    out = tmp_path / "a.webm"
    assert mien("animate", timeline, "--head", expressive, "-o", out).status == 0
    with av.open(out) as container:
        assert container.streams.video[0].metadata["alpha_mode"] == "1"
    (first, *_) = frames_in(out, "libvpx-vp9")
    alpha = first.to_ndarray(format="rgba")[..., 3]
    assert alpha[0, 0] < 5
    assert alpha[60, 48] > 250
    out = tmp_path / "b.webm"
    mien("animate", timeline, "--head", expressive, "-o", out, "--background", "#000000")
    with av.open(out) as container:
        assert "alpha_mode" not in container.streams.video[0].metadata


@pytest.mark.parametrize("name", ["frames", "take.v1/"])
def test_a_folder_of_pictures(
    name: str, expressive: Path, timeline: Path, mien: Mien, tmp_path: Path
) -> None:
    """Each is what the rig and the renderer make of that moment."""
    out = f"{tmp_path}/{name}"
    assert mien("animate", timeline, "--head", expressive, "-o", out, "--json").json["frames"] == 5
    files = sorted(Path(out).iterdir())
    assert [file.name for file in files] == [f"frame_{i:06}.png" for i in range(5)]
    renderer, played = HeadRenderer(load_head(expressive)), load_timeline(timeline)
    moment = played.at(0.4)
    camera = renderer.camera(size=SIZE)
    turned = type(camera)(
        *(camera.width, camera.height, camera.focal_px),
        camera.R_cam_head @ moment.rotation,
        camera.R_cam_head @ moment.translation + camera.t_cam_head,
    )
    with Image.open(files[4]) as image:
        np.testing.assert_array_equal(np.asarray(image), renderer.draw(moment.state, turned))


def test_the_head_turns_to_its_own_left(expressive: Path, timeline: Path, tmp_path: Path) -> None:
    """Turned from the start, or by the timeline: the same picture."""
    head = load_head(expressive)
    still = written(tmp_path, {"head": {"yaw": 30}}, pivot=middle_of(head).tolist())
    animate_head(head, still, tmp_path / "a", fps=2)
    resting = written(tmp_path, {})
    animate_head(head, resting, tmp_path / "b", fps=2, yaw=np.radians(30))
    one, other = (
        np.asarray(Image.open(tmp_path / name / "frame_000000.png")).astype(int) for name in "ab"
    )
    assert (np.abs(one - other).max(axis=2) > 8).mean() < 0.002


def middle_of(head: Head) -> Array:
    vertices = head.mesh.vertices
    return (vertices.min(axis=0) + vertices.max(axis=0)) / 2


def test_live_link_round_trip(expressive: Path, timeline: Path, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / "a.csv"
    assert mien("animate", timeline, "--head", expressive, "-o", out, "--json").json["frames"] == 5
    given, back = load_timeline(timeline), load_timeline(out)
    times = frame_times(given)
    wanted, found = given.sample(times), back.sample(times)
    for channel in ("units.jawOpen", "units.eyeBlinkLeft", "head.yaw"):
        np.testing.assert_allclose(found[channel], wanted[channel], atol=1e-6)
    assert mien("animate", out, "--head", expressive, "-o", tmp_path / "b.fap").status == 0


def test_live_link_has_the_units_of_the_expressions(expressive: Path, tmp_path: Path) -> None:
    tracks = {"face": {"joy": 0.5}, "right_mouth": {"joy": -0.25}, "units": {"mouthSmileLeft": 0.1}}
    animate_head(load_head(expressive), written(tmp_path, tracks), tmp_path / "a.csv")
    values = load_timeline(tmp_path / "a.csv").sample(np.zeros(1))
    assert values["units.mouthSmileLeft"] == pytest.approx(0.6)
    assert values["units.mouthSmileRight"] == pytest.approx(0.25)


def test_facial_animation_parameters(
    expressive: Path, timeline: Path, mien: Mien, tmp_path: Path
) -> None:
    out = tmp_path / "a.fap"
    assert mien("animate", timeline, "--head", expressive, "-o", out).status == 0
    lines = out.read_text().splitlines()
    assert lines[0] == "2.1 a 10 5"
    assert len(lines) == 1 + 2 * 5


@pytest.mark.parametrize("suffix", [".glb", ".usdz"])
def test_a_model_that_moves(
    suffix: str, expressive: Path, timeline: Path, mien: Mien, tmp_path: Path
) -> None:
    out = tmp_path / f"a{suffix}"
    assert mien("animate", timeline, "--head", expressive, "-o", out, "--json").json["frames"] == 5
    assert out.stat().st_size > 100_000
    if suffix == ".glb":
        (animation,) = Glb(out.read_bytes()).json["animations"]
        paths = {channel["target"]["path"] for channel in animation["channels"]}
        assert paths == {"weights", "rotation", "translation"}


def test_from_python(expressive: Path, tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    take = animate_head(
        load_head(expressive),
        Timeline(duration=0.3, fps=10),
        tmp_path / "a",
        size=(32, 40),
        progress=lambda *step: told.append(step),
    )
    assert take == AnimationResult(frames=3)
    assert told == [("Animating", done, 3) for done in range(4)]


def test_past_what_was_photographed_is_noted_once(
    expressive: Path, mien: Mien, tmp_path: Path
) -> None:
    path = written(tmp_path, {"face": {"joy": {"keys": [[0, 0.9], [0.2, 1.2], [0.5, 1.3]]}}})
    ran = mien("animate", path, "--head", expressive, "-o", tmp_path / "a.csv")
    (note,) = ran.err.strip().splitlines()[-1:]
    assert note.startswith("note: face: past what was photographed (weights outside 0 to 1): ")
    assert note.endswith(" at 0.40 s"), "where it goes farthest"
    assert ran.err.count("note: ") == 1


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"tracks": {"mouth": {"joi": 1}}}, "tracks.mouth.joi: "),
        ({"tracks": {"units": {"jawOpn": 1}}}, "tracks.units.jawOpn: "),
        ({"tracks": {"moth": {"joy": 1}}}, "tracks.moth: "),
        ({"tracks": {"face": {"joy": [[0, 0], [0.4, 1], [0.3, 0]]}}}, "tracks.face.joy.keys[2]"),
        ({"tracks": {"face": {"joy": float("nan")}}}, "tracks.face.joy: "),
        ({"tracks": {"face": {"joy": [[0, 0], [0.4, 2]]}}}, "at 0.30 s: weight of joy: expected"),
        (
            {"tracks": {"units": {"jawOpen": [[0, 0], [0.4, 50]]}}},
            "at 0.10 s: unit jawOpen: expected -0.5 to 1.5, got 7.8125; weights in percent?",
        ),
        ({"duration": 86_400, "fps": 1000}, "frames: expected at most 1000000, found 86400 s at 1"),
        ({"size": [16_384, 16_384]}, "size[0]: expected a number above 0 and at most 8192, found"),
        (
            {
                "duration": 86_400,
                "fps": 1,
                "layers": [
                    {
                        "generator": "blink",
                        "period": 0.1,
                        "jitter": 0,
                        "closing": 0.01,
                        "closed": 0.01,
                        "opening": 0.01,
                    }
                ]
                * 2,
            },
            "layers: expected at most 1000000 blinks and breaths, found 1728000 in 86400 s",
        ),
        ({"duration": -1}, "duration: "),
        ({"play": [{"clip": "nod", "at": 0}]}, "play[0].clip: "),
    ],
)
def test_a_bad_timeline_is_named_with_its_place(
    document: dict[str, Any], message: str, expressive: Path, mien: Mien, tmp_path: Path
) -> None:
    path = written(tmp_path, **document)
    error = mien("animate", path, "--head", expressive, "-o", tmp_path / "a.mp4", "--json").error
    assert error.startswith(f"{path}: {message}")
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "a.avi"], "a.avi: expected a name that ends in .mp4, .webm, .glb, .usdz, .csv,"),
        (["-o", "a.mp4", "--fps", 0], "Invalid value for '--fps'"),
        (["-o", "a.mp4", "--fps", 1e9], "Invalid value for '--fps'"),
        (["-o", "a.mp4", "--fps", "nan"], "Invalid value for '--fps'"),
        (["-o", "a.fap", "--fps", 12.5], "a.fap: expected a whole number of frames a second"),
        (["-o", "a.mp4", "--size", "5"], "--size: expected WIDTHxHEIGHT in px"),
        (["-o", "a.mp4", "--background", "blue"], "--background: expected a colour"),
        (["-o", "a.mp4", "--yaw", "nan"], "--yaw: expected a finite number, got nan"),
        ([], "Missing option '-o'"),
    ],
)
def test_bad_options(
    options: list[object],
    message: str,
    expressive: Path,
    timeline: Path,
    mien: Mien,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = mien("animate", timeline, "--head", expressive, "--json", *options)
    assert ran.error.startswith(message)
    assert [path.name for path in tmp_path.iterdir()] == ["take.json"]


def test_a_rate_that_makes_too_many_frames(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    path = written(tmp_path, duration=3600)
    error = mien(
        "animate", path, "--head", expressive, "-o", tmp_path / "a.fap", "--fps", 1000
    ).error
    assert (
        error == f"{path}: frames: expected at most 1000000, found 3600 s at 1000 frames a second"
    )


def test_properties_of_the_recording_are_noted(
    expressive: Path, mien: Mien, tmp_path: Path
) -> None:
    path = written(tmp_path)
    mien("animate", path, "--head", expressive, "-o", tmp_path / "a.csv")
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    sparse = [f"00:00:0{i}:00.000{row[15:]}" for i, row in enumerate(rows)]
    (tmp_path / "b.csv").write_text("\n".join([header, sparse[0], *sparse]) + "\n")
    ran = mien("animate", tmp_path / "b.csv", "--head", expressive, "-o", tmp_path / "c.csv")
    assert [line for line in ran.err.splitlines() if line.startswith("note: ")] == [
        "note: b.csv: a row repeats the timecode of the row before; the first of them counts",
        "note: b.csv: a row every 1 s; what the face did in between is not in it",
    ]


def test_files_that_are_no_timeline(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    for name, message in (("no.json", ""), ("take.txt", "expected a name that ends in .json or")):
        path = tmp_path / name
        error = mien("animate", path, "--head", expressive, "-o", tmp_path / "a.mp4").error
        assert error.startswith(f"{path}: {message}")


def test_a_folder_with_other_things_is_left_alone(
    expressive: Path,
    timeline: Path,
    mien: Mien,
    tmp_path: Path,
    contents: Contents,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("the place is checked before the work")

    monkeypatch.setattr(HeadRenderer, "draw", refuse)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    before = contents(tmp_path)
    error = mien("animate", timeline, "--head", expressive, "-o", tmp_path / "mine").error
    assert error.startswith(f"{tmp_path / 'mine'}: expected a new folder or one made by mien")
    assert contents(tmp_path) == before


def stop_after(monkeypatch: pytest.MonkeyPatch, frames: int, error: BaseException) -> None:
    """The renderer goes so far and no further."""
    draw, drawn = HeadRenderer.draw, []

    def draw_or_stop(*arguments: Any, **options: Any) -> Any:
        if len(drawn) == frames:
            raise error
        drawn.append(1)
        return draw(*arguments, **options)

    monkeypatch.setattr(HeadRenderer, "draw", draw_or_stop)


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "frames"])
def test_a_run_that_is_interrupted_leaves_what_was_there(
    name: str,
    expressive: Path,
    timeline: Path,
    mien: Mien,
    tmp_path: Path,
    contents: Contents,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / name
    assert mien("animate", timeline, "--head", expressive, "-o", out).status == 0
    before = contents(tmp_path)
    for error, status in ((KeyboardInterrupt(), 130), (OSError(28, "No space left on device"), 2)):
        with monkeypatch.context() as patch:
            stop_after(patch, 3, error)
            ran = mien("animate", timeline, "--head", expressive, "-o", out, "--json")
        assert ran.status == status
        assert contents(tmp_path) == before
    assert (
        ran.error == f"{out}: expected a place that can be written to, got No space left on device"
    )


def test_memory_is_flat(expressive: Path, tmp_path: Path) -> None:
    """Twenty frames more take no more than one picture more."""
    head, peaks = load_head(expressive), []
    for duration in (0.4, 2.4):
        tracemalloc.start()
        animate_head(head, Timeline(duration=duration, fps=10), tmp_path / "a.mp4", size=(192, 240))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 4 * 192 * 240 * 4
