"""Live Link Face CSV: the app's own columns, signs and timecodes; what is written comes back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from mien.animate.channels import head_rotation
from mien.animate.curves import Curve, constant
from mien.animate.perform import frame_times
from mien.animate.timeline import Timeline
from mien.assets.generic import load_generic_head
from mien.errors import FileFormatError, InputError
from mien.io.live.live_link import UNITS
from mien.io.live.live_link_csv import load_live_link, save_live_link, timecode
from moments import moments

HEADER = (
    "Timecode,BlendShapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,"
    "EyeLookUpLeft,EyeSquintLeft,EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,"
    "EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,JawForward,JawRight,JawLeft,"
    "JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,MouthSmileLeft,"
    "MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,"
    "MouthStretchLeft,MouthStretchRight,MouthRollLower,MouthRollUpper,MouthShrugLower,"
    "MouthShrugUpper,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight,"
    "MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,"
    "BrowOuterUpRight,CheekPuff,CheekSquintLeft,CheekSquintRight,NoseSneerLeft,NoseSneerRight,"
    "TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,"
    "RightEyePitch,RightEyeRoll"
)


def performance(fps: float = 30.0, seconds: float = 2.5, **more: Curve) -> Timeline:
    rng = np.random.default_rng(5)
    tracks = {f"units.{u}": Curve([0, 1, 2], rng.uniform(0, 1, 3)) for u in UNITS}
    tracks |= {f"head.{a}": Curve([0, 1, 2], rng.uniform(-0.6, 0.6, 3)) for a in ("yaw", "pitch")}
    return Timeline(seconds, fps=fps, tracks=tracks | {"head.roll": constant(0.2)} | more)


def test_the_header_is_the_apps(tmp_path: Path) -> None:
    save_live_link(tmp_path / "a.csv", moments(performance()))
    assert (tmp_path / "a.csv").read_text().splitlines()[0] == HEADER
    assert sorted(UNITS) == sorted(load_generic_head().unit_names)


@pytest.mark.parametrize("fps", [12.0, 24.0, 25.0, 29.97, 30.0, 59.94, 60.0, 120.0])
@pytest.mark.parametrize("seconds", [0.4, 2.5])
def test_a_performance_round_trips(tmp_path: Path, fps: float, seconds: float) -> None:
    timeline = performance(fps, seconds)
    given = list(moments(timeline))
    assert save_live_link(tmp_path / "a.csv", given) == len(given)
    loaded = load_live_link(tmp_path / "a.csv")
    times = np.array([moment.time for moment in given])
    assert loaded.fps == pytest.approx(fps, rel=2e-3)
    assert loaded.duration == pytest.approx(seconds, abs=1.5 / fps)
    curve = loaded.tracks["units.jawOpen"]
    np.testing.assert_allclose(curve.times, times, atol=1e-5)
    for unit in UNITS:
        printed = [round(moment.state.units[unit], 10) for moment in given]
        np.testing.assert_allclose(loaded.tracks[f"units.{unit}"].values, printed, atol=1e-10)
    for moment, back in zip(given, loaded.moments_at(curve.times), strict=True):
        np.testing.assert_allclose(back.rotation, moment.rotation, atol=1e-8)


def test_angles_have_the_apps_signs(tmp_path: Path) -> None:
    tracks = {"gaze.yaw": constant(0.2), "gaze.pitch": constant(-0.1), "head.yaw": constant(0.3)}
    save_live_link(tmp_path / "a.csv", moments(Timeline(0.01, tracks=tracks)))
    row = next(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    number = {name: float(row[name]) for name in HEADER.split(",")[2:]}
    # As in a recording of the app: looking left and down, EyeLookOutLeft and EyeLookInRight go
    # with negative yaws, EyeLookDown with positive pitches.
    assert number["EyeLookOutLeft"] == number["EyeLookInRight"] > 0
    assert number["EyeLookInLeft"] == number["EyeLookOutRight"] == 0
    assert number["LeftEyeYaw"] == number["RightEyeYaw"] == pytest.approx(-0.2)
    assert number["LeftEyePitch"] == number["RightEyePitch"] == pytest.approx(0.1)
    assert number["EyeLookDownLeft"] > 0
    assert (number["HeadYaw"], number["HeadPitch"]) == (pytest.approx(-0.3), 0)
    assert row["BlendShapeCount"] == "61"


def test_what_is_written_can_be_read(tmp_path: Path) -> None:
    """Eyes that look farther than any, and expressions whose units add up."""
    tracks = {"gaze.yaw": constant(1.2), "units.eyeLookOutLeft": constant(1.0)}
    units = {"jawOpen": 1.9, "mouthPucker": -0.8}
    save_live_link(
        tmp_path / "a.csv", moments(Timeline(0.1, tracks=tracks)), units_of=lambda state: units
    )
    found = load_live_link(tmp_path / "a.csv").at(0).state.units
    assert (found["jawOpen"], found["mouthPucker"], found["eyeLookOutLeft"]) == (1.5, -0.5, 1.5)


def test_head_angles_are_unreals(tmp_path: Path) -> None:
    path = recording(tmp_path, HeadYaw="-0.4", HeadPitch="0.3", HeadRoll="-0.2")
    found = load_live_link(path).at(0).rotation
    turn, tip = head_rotation(0.4, 0, 0), head_rotation(0, 0.3, 0)
    np.testing.assert_allclose(found, turn @ tip @ head_rotation(0, 0, 0.2), atol=1e-12)


def test_units_of_lets_the_caller_explain_expressions(tmp_path: Path) -> None:
    timeline = Timeline(0.1, tracks={"mouth.joy": constant(0.5)})
    save_live_link(
        tmp_path / "a.csv",
        moments(timeline),
        units_of=lambda state: {"mouthSmileLeft": state.expressions["mouth"]["joy"]},
    )
    assert load_live_link(tmp_path / "a.csv").at(0).state.units == {"mouthSmileLeft": 0.5}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "00:00:00:00.000"),
        (0.99999999, "00:00:01:00.000"),
        (1 / 120, "00:00:00:00.500"),
        (3725.5, "01:02:05:30.000"),
    ],
)
def test_timecodes(seconds: float, text: str) -> None:
    assert timecode(seconds) == text


NAMES = HEADER.split(",")
CODES = ("12:00:00:56.250", "12:00:00:58.250", "12:00:01:00.250", "12:00:01:02.250")


def recording(
    folder: Path,
    names: list[str] = NAMES,
    codes: tuple[str, ...] = CODES,
    lines: dict[int, str] | None = None,
    **cells: str,
) -> Path:
    """A small file as the app writes it; by line, other text than that."""
    rows = [",".join(names)]
    for index, code in enumerate(codes):
        values = {"Timecode": code, "BlendShapeCount": "61", "JawOpen": f"0.{index}"} | cells
        lower = {name.lower(): value for name, value in values.items()}
        rows.append(",".join(lower.get(name.lower(), "0.0000000000") for name in names))
    for index, text in (lines or {}).items():
        rows[index - 1] = text
    path = folder / "take.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_columns_are_found_by_name_whatever_their_order(tmp_path: Path) -> None:
    names = [name for name in NAMES[::-1] if name != "TongueOut"]
    loaded = load_live_link(recording(tmp_path, names))
    curve = loaded.tracks["units.jawOpen"]
    np.testing.assert_allclose(curve.times, np.arange(4) / 30, atol=1e-9)
    np.testing.assert_array_equal(curve.values, [0, 0.1, 0.2, 0.3])
    assert loaded.fps == 30
    others = [name[:1].lower() + name[1:] for name in NAMES[:54]]
    again = load_live_link(recording(tmp_path, [*others, "somethingElse"]))
    np.testing.assert_array_equal(again.tracks["units.jawOpen"].values, curve.values)


def test_a_recording_may_count_other_frames_and_pass_midnight(tmp_path: Path) -> None:
    codes = tuple(f"23:59:59:{f:02}.000" for f in range(20, 24))
    codes += tuple(f"00:00:00:{f:02}.000" for f in range(4))
    times = (
        load_live_link(recording(tmp_path, codes=codes), timecode_rate=24)
        .tracks["units.jawOpen"]
        .times
    )
    np.testing.assert_allclose(times, np.arange(8) / 24, atol=1e-9)
    codes = tuple(f"01:00:{n // 24:02}:{n % 24:02}.000" for n in range(20, 60))
    found = load_live_link(recording(tmp_path, codes=codes))
    np.testing.assert_allclose(found.tracks["units.jawOpen"].times, np.arange(40) / 24, atol=1e-9)


def test_frames_without_a_face_are_bridged(tmp_path: Path) -> None:
    path = recording(tmp_path, lines={3: "12:00:00:58.250,0", 4: ""})
    loaded = load_live_link(path)
    assert loaded.tracks["units.jawOpen"].values.tolist() == [0.0, 0.3]


TWICE = HEADER.replace("JawLeft", "JawRight")
BAD = [
    ({1: "frame,time"}, "line 1: expected a Live Link Face recording, whose first line starts"),
    ({1: HEADER.replace("JawOpen", "Jaw")}, "line 1: no column for the face unit jawOpen"),
    ({1: "Timecode,BlendShapeCount"}, "no column for the face unit eyeBlinkLeft and 50 others"),
    ({1: TWICE}, "line 1: the column 'jawright' appears twice"),
    ({3: "12:00:00.5,61,0.5"}, "line 3, Timecode: expected HH:MM:SS:FF.sss, found '12:00:00.5'"),
    ({3: "12:00:61:02,61,0.5"}, "line 3, Timecode: expected HH:MM:SS:FF.sss"),
    ({3: "12:00:00:58,61,x"}, "line 3, EyeBlinkLeft: expected a finite number, found 'x'"),
    ({3: "12:00:00:58,61,nan"}, "line 3, EyeBlinkLeft: expected a finite number, found 'nan'"),
    ({3: "12:00:00:58,61,0.5"}, "line 3, EyeLookDownLeft: expected a finite number, found ''"),
]


BAD += [
    ({3: "12:00:00:58,61,50"}, "line 3, EyeBlinkLeft: 50: weights in percent? expected a number"),
    ({3: "12:00:00:58,61,-12.3"}, "line 3, EyeBlinkLeft: -12.3: weights in percent? expected"),
    ({3: "12:00:00:58,61,1e8"}, "line 3, EyeBlinkLeft: 1e+08: expected a number from -0.5 to 1.5"),
    ({3: "12:00:00:58,61,1e308"}, "line 3, EyeBlinkLeft: expected a number from -1e+09 to 1e+09"),
    ({3: "12:00:00:58,61,0,1" + ",0" * 61}, "line 3: expected 63 cells, found 65: decimal commas"),
    (
        {3: "11:59:59:58,61" + ",0" * 61},
        "line 3, Timecode: expected a time after that of the frame",
    ),
    (
        {5: "13:00:02:58,61" + ",0" * 61},
        "line 5, Timecode: expected a time at most 3600 s after the",
    ),
    ({3: "12:00:00:58,61" + ",0" * 52 + ",30,0,0"}, "line 3, HeadYaw: 30: angles in degrees? exp"),
]


@pytest.mark.parametrize(("lines", "message"), BAD)
def test_bad_files_raise_one_line_errors(tmp_path: Path, lines: dict, message: str) -> None:
    path = recording(tmp_path, lines=lines)
    with pytest.raises(FileFormatError) as caught:
        load_live_link(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_times_must_rise(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="line 4, Timecode: expected a time after that of"):
        load_live_link(recording(tmp_path, codes=(CODES[0], CODES[2], CODES[1])))


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with pytest.raises(InputError, match="expected a readable file"):
        load_live_link(path)
    for content, message in ((b"", "an empty file"), (b"\xff\xfe\0", "found other bytes")):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=message):
            load_live_link(path)
    path.write_text(HEADER + "\n")
    with pytest.raises(FileFormatError, match="expected frames, found none with values"):
        load_live_link(path)


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one frame to write"):
        save_live_link(tmp_path / "a.csv", [])
    timeline = Timeline(0.1, tracks={"units.earWiggle": constant(1)})
    with pytest.raises(InputError, match=r"one of the 52 .* got earWiggle"):
        save_live_link(tmp_path / "a.csv", moments(timeline))
    with pytest.raises(InputError, match="a frame at 0 s or later, got -1 s"):
        save_live_link(tmp_path / "a.csv", [Timeline(1.0).at(-1.0)])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\n\n"])
def test_recordings_that_went_through_a_spreadsheet(
    tmp_path: Path, separator: str, end: str
) -> None:
    """Other separators, decimal commas, a mark at the beginning, empty lines and cells."""
    path = recording(tmp_path)
    given = load_live_link(path).tracks["units.jawOpen"]
    rows = [line.replace(",", separator).replace(".", ",") for line in path.read_text().split()]
    text = end.join(row + 2 * separator for row in ["", *rows, "", ""])
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    found = load_live_link(path).tracks["units.jawOpen"]
    np.testing.assert_array_equal(found.times, given.times)
    np.testing.assert_array_equal(found.values, given.values)


def test_quoted_decimal_commas_between_commas(tmp_path: Path) -> None:
    path = recording(tmp_path)
    path.write_text(path.read_text().replace(",0.1,", ',"0,1",'))
    assert load_live_link(path).tracks["units.jawOpen"].values.tolist() == [0, 0.1, 0.2, 0.3]


def test_of_rows_with_one_timecode_the_first_counts_and_it_is_noted(tmp_path: Path) -> None:
    codes = (CODES[0], CODES[1], CODES[1], CODES[2], CODES[2])
    loaded = load_live_link(recording(tmp_path, codes=codes))
    assert loaded.tracks["units.jawOpen"].values.tolist() == [0, 0.1, 0.3]
    assert loaded.notes == (
        "take.csv: 2 rows repeat the timecode of the row before; the first of them counts",
    )
    assert load_live_link(recording(tmp_path)).notes == ()


def test_a_row_a_second_is_noted(tmp_path: Path) -> None:
    codes = tuple(f"12:00:0{second}:00.000" for second in range(5))
    loaded = load_live_link(recording(tmp_path, codes=codes))
    assert (loaded.fps, loaded.duration) == (1.0, 5.0)
    assert loaded.notes == ("take.csv: a row every 1 s; what the face did in between is not in it",)


def test_two_rows_far_apart_still_have_a_rate(tmp_path: Path) -> None:
    loaded = load_live_link(recording(tmp_path, codes=("12:00:00:00.000", "13:00:00:00.000")))
    assert (loaded.fps, loaded.duration) == (0.01, 3601.0)
    assert len(frame_times(loaded)) == 36


def test_weights_in_percent_are_asked_about(shared: Path) -> None:
    path = shared / "data" / "cases" / "percent_livelink" / "percent.csv"
    with pytest.raises(FileFormatError) as caught:
        load_live_link(path)
    assert str(caught.value).startswith(f"{path}: line 2, EyeBlinkLeft: 50: weights in percent?")
    seconds = load_live_link(path.with_name("second_per_row.csv"))
    assert seconds.fps == 1
    assert "a row every 1 s" in seconds.notes[0]
