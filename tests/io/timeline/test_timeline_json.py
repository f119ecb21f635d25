"""Timeline documents: what is written comes back, and every mistake is told with its place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mien.animate.curves import Curve, constant
from mien.animate.layers import Blink, Breathing
from mien.animate.timeline import Clip, Layer, Placement, Timeline
from mien.errors import FileFormatError, InputError
from mien.io.timeline.timeline_file import check_timeline
from mien.io.timeline.timeline_json import load_timeline_json, save_timeline

MIXED = Curve(
    [0.0, 0.5, 1.25, 3.0],
    [0.0, 0.2, -0.1, 1.1],
    ("cubic", "hold", "linear", "cubic"),
    slopes_in=[np.nan, 0.25, np.nan, np.nan],
    slopes_out=[np.nan, -1.5, np.nan, 0.125],
)
FULL = Timeline(
    4.0,
    fps=29.97,
    size=(640, 800),
    pivot=np.array([0.0, -55.5, -81.0]),
    tracks={
        "units.jawOpen": MIXED,
        "mouth.joy": Curve([0, 1], [0, 1]),
        "face.anger": constant(0.3),
        "head.yaw": Curve([0.0, 2.0], np.radians([0.0, 10.0]), slopes_in=[np.nan, 0.1]),
        "head.y": constant(2.5),
        "gaze.pitch": constant(np.radians(-7)),
    },
    placements=(Placement("nod", 0.5, 2.0, 0.7, 1.5),),
    clips={
        "nod": Clip(1.0, {"head.pitch": Curve([0, 0.5, 1], [0, 0.1, 0])}),
        "two": Clip(2.5, placements=(Placement("nod", 0.0), Placement("nod", 1.0))),
    },
    layers=(
        Layer("blink", generator=Blink(seed=5, period=3.0)),
        Layer("air", weight=Curve([0, 1], [0, 1]), generator=Breathing(seed=2)),
        Layer("more", tracks={"units.jawOpen": constant(0.1)}, placements=(Placement("two", 1),)),
    ),
)


def test_a_timeline_round_trips(tmp_path: Path) -> None:
    save_timeline(tmp_path / "a.json", FULL)
    loaded = load_timeline_json(tmp_path / "a.json")
    times = np.linspace(-1, 5, 301)
    expected, found = FULL.sample(times), loaded.sample(times)
    assert found.keys() == expected.keys()
    for channel in expected:
        np.testing.assert_allclose(found[channel], expected[channel], atol=1e-11, err_msg=channel)
    assert (loaded.duration, loaded.fps, loaded.size) == (4.0, 29.97, (640, 800))
    assert loaded.placements == FULL.placements
    save_timeline(tmp_path / "b.json", loaded)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_a_document_reads_well(tmp_path: Path) -> None:
    save_timeline(tmp_path / "a.json", FULL)
    lines = (tmp_path / "a.json").read_text().splitlines()
    key = '{ "time": 0.5, "value": 0.2, "interpolation": "hold", "in": 0.25, "out": -1.5 },'
    assert key in [line.strip() for line in lines]
    assert lines[5:7] == ['  "size": [ 640, 800 ],', '  "pivot": [ 0.0, -55.5, -81.0 ],']


def test_angles_are_degrees_in_the_file(tmp_path: Path) -> None:
    path = write(tmp_path, tracks={"head": {"yaw": 30}, "gaze": {"pitch": [[0, 0], [1, -10]]}})
    found = load_timeline_json(path).sample([1.0])
    assert found["head.yaw"][0] == pytest.approx(np.radians(30))
    assert found["gaze.pitch"][0] == pytest.approx(np.radians(-10))


def write(folder: Path, **changes: Any) -> Path:
    data = {"format": "mien timeline", "version": 1, "duration": 2.0} | changes
    path = folder / "timeline.json"
    path.write_text(json.dumps({k: v for k, v in data.items() if v is not ...}))
    return path


def keys(*pairs: Any) -> dict[str, Any]:
    return {"mouth": {"joy": {"keys": list(pairs)}}}


BREATH = {"generator": "breathing"}
BAD: list[tuple[dict[str, Any], str]] = [
    ({"format": "mien head"}, "format: expected 'mien timeline', found 'mien head'"),
    ({"version": 2}, "version: 2 was written by a newer mien; this one reads up to 1"),
    ({"version": "1"}, "version: expected a whole number, found text '1'"),
    ({"duration": ...}, "duration: missing"),
    ({"duration": -3}, "duration: expected a number above 0 and at most 86400, found -3"),
    ({"duration": float("nan")}, "duration: expected a finite number, found nan"),
    ({"duration": True}, "duration: expected a number, found true or false"),
    ({"fps": 0}, "fps: expected a number from 0.01 to 1000, found 0"),
    ({"fps": 5000}, "fps: expected a number from 0.01 to 1000, found 5000"),
    ({"size": [640]}, "size: expected [width, height], found 1 entries"),
    ({"size": [640, 0.5]}, "size[1]: expected a whole number, found a number"),
    ({"pivot": [0, 1]}, "pivot: expected 3 numbers, found 2 entries"),
    ({"pivot": [0, 1, None]}, "pivot[2]: expected a number, found null"),
    ({"trakcs": {}}, "trakcs: unknown key 'trakcs'; did you mean tracks?"),
    ({"tracks": []}, "tracks: expected an object, found a list"),
    ({"tracks": {"muoth": {}}}, "tracks.muoth: unknown key 'muoth'; did you mean mouth?"),
    ({"tracks": {"left_eyes": {}}}, "unknown key 'left_eyes'; did you mean left_eye"),
    ({"tracks": {"head": {"yav": 1}}}, "tracks.head.yav: unknown key 'yav'; did you mean yaw?"),
    ({"tracks": {"units": {"jawOpen": "x"}}}, "tracks.units.jawOpen: expected a number, a list of"),
    ({"tracks": keys()}, "tracks.mouth.joy.keys: expected at least one key, found none"),
    (
        {"tracks": keys([0, 0], [1, 1], [2, 0], [1.5, 1])},
        "tracks.mouth.joy.keys[3].time: expected a time after the 2 s of the key before, found 1.5",
    ),
    (
        {"tracks": keys([0, 0], {"time": 0, "value": 1})},
        "tracks.mouth.joy.keys[1].time: expected a time after the 0 s of the key before, found 0 s",
    ),
    (
        {"tracks": keys([0, float("inf")])},
        "tracks.mouth.joy.keys[0].value: expected a finite number, found inf",
    ),
    (
        {"tracks": keys([float("nan"), 1])},
        "tracks.mouth.joy.keys[0].time: expected a finite number, found nan",
    ),
    (
        {"tracks": keys([0, 1e300])},
        "keys[0].value: expected a number from -1e+09 to 1e+09",
    ),
    ({"tracks": keys([10**400, 1])}, "keys[0].time: expected a finite number, found inf"),
    ({"tracks": keys([1, 2, 3])}, "tracks.mouth.joy.keys[0]: expected [time, value], found 3"),
    ({"tracks": keys({"time": 1})}, "tracks.mouth.joy.keys[0].value: missing"),
    (
        {"tracks": keys({"time": 1, "value": 2, "interpolate": "hold"})},
        "keys[0].interpolate: unknown key 'interpolate'; did you mean interpolation?",
    ),
    (
        {"tracks": keys({"time": 1, "value": 2, "interpolation": "cubik"})},
        "keys[0].interpolation: unknown interpolation 'cubik'; did you mean cubic?",
    ),
    ({"play": [{"clip": "smile"}]}, "play[0].clip: unknown clip 'smile'"),
    (
        {"play": [{"clip": "smil", "at": 0}], "clips": {"smile": {"duration": 1}}},
        "play[0].clip: unknown clip 'smil'; did you mean smile?",
    ),
    (
        {"play": [{"clip": "a", "at": 0, "speed": 0}], "clips": {"a": {"duration": 1}}},
        "play[0].speed: expected a number above 0 and at most 1e+09, found 0",
    ),
    ({"clips": {"a": {}}}, "clips.a.duration: missing"),
    (
        {"clips": {"a": {"duration": 1, "play": [{"clip": "a", "at": 0}]}}},
        "clips.a: expected a clip that does not contain itself, found a > a",
    ),
    ({"layers": [{"generator": "blnk"}]}, "layers[0].generator: unknown generator 'blnk'; did you"),
    ({"layers": [BREATH | {"closing": 1}]}, "layers[0].closing: unknown key 'closing'"),
    (
        {"layers": [BREATH | {"period": -1}]},
        "layers[0].period: expected a number of seconds from 0.1 up",
    ),
    ({"layers": [BREATH | {"seed": 1.5}]}, "layers[0].seed: expected a whole number"),
    ({"layers": [{"name": 3}]}, "layers[0].name: expected text, found a number"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message[:60] for _, message in BAD])
def test_mistakes_are_named_with_their_place(tmp_path: Path, changes: dict, message: str) -> None:
    path = write(tmp_path, **changes)
    with pytest.raises(FileFormatError) as caught:
        load_timeline_json(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "line 1, column 2: expected JSON"),
        (b"\xff\xfe{}", "expected JSON in UTF-8, found other bytes"),
        (b"[1]", "expected an object, found a list"),
        (b'{"format": 1, "format": 2}', "format: the name appears twice"),
        (b"[" * 100_000, "expected lists and objects at most 64 deep"),
        (b'{"version": ' + b"9" * 5000 + b"}", "at most 1000 digits, found 5000"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "timeline.json"
    path.write_bytes(content)
    with pytest.raises(FileFormatError) as caught:
        load_timeline_json(path)
    assert message in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.json: expected a readable file"):
        load_timeline_json(tmp_path / "nothing.json")


def test_a_head_must_have_what_a_timeline_moves() -> None:
    names = {"expressions": ("neutral", "joy", "anger"), "units": ("jawOpen", "mouthSmileLeft")}
    eyes = ("eyeBlinkLeft", "eyeBlinkRight")
    check_timeline(FULL, expressions=names["expressions"], units=(*names["units"], *eyes))
    with pytest.raises(FileFormatError) as caught:
        check_timeline(FULL, path="t.json", **names)
    assert str(caught.value).startswith(
        "t.json: layers[0].generator.units.eyeBlinkLeft: unknown unit"
    )
    for tracks, message in (
        (
            {"mouth.joi": constant(1)},
            "tracks.mouth.joi: unknown expression 'joi'; did you mean joy?",
        ),
        (
            {"muoth.joy": constant(1)},
            "tracks.muoth.joy: unknown region 'muoth'; did you mean mouth",
        ),
        ({"units.jawOpn": constant(1)}, "tracks.units.jawOpn: unknown unit 'jawOpn'; did you mean"),
    ):
        with pytest.raises(FileFormatError) as caught:
            check_timeline(Timeline(1.0, tracks=tracks), **names)
        assert message in str(caught.value)
    clip = Clip(1.0, {"face.sad": constant(1)})
    with pytest.raises(FileFormatError, match=r"clips\.a\.tracks\.face\.sad: unknown expression"):
        check_timeline(Timeline(1.0, clips={"a": clip}), **names)
