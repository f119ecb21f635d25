from __future__ import annotations

import pytest

from mien.cli.options import (
    check_finite,
    parse_amounts,
    parse_angles,
    parse_colour,
    parse_count,
    parse_regions,
    parse_size,
    parse_state,
)
from mien.errors import InputError
from mien.rig.state import FaceState, Gaze


def test_sizes() -> None:
    assert parse_size("--size", "800x1000") == (800, 1000)
    assert parse_size("--size", "1X8192") == (1, 8192)


@pytest.mark.parametrize("text", ["", "800", "x", "800x", "-1x5", "1.5x2", "0x4", "4x4x4", "²x4"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(InputError, match="--size: expected WIDTHxHEIGHT in px"):
        parse_size("--size", text)


@pytest.mark.parametrize("text", ["999999x999999", "8193x1", "9" * 5000 + "x1", "1x" + "9" * 5000])
def test_what_is_too_large(text: str) -> None:
    with pytest.raises(InputError, match="--size: expected at most 8192 px a side") as caught:
        parse_size("--size", text)
    assert len(str(caught.value)) < 100


def test_amounts() -> None:
    texts = ["jawOpen=0.5", "eyeBlinkLeft=-1e-1", "jawOpen=1"]
    assert parse_amounts("--unit", texts) == {"jawOpen": 1.0, "eyeBlinkLeft": -0.1}
    assert parse_amounts("--unit", []) == {}
    assert parse_amounts("--expression", ["a=b=0.5", "=c==.5"]) == {"a=b": 0.5, "=c=": 0.5}


@pytest.mark.parametrize("text", ["", "jawOpen", "=1", "jawOpen=", "jawOpen=inf", "a=1_0", "a=٣"])
def test_what_is_no_amount(text: str) -> None:
    with pytest.raises(InputError, match="--unit: expected NAME=AMOUNT"):
        parse_amounts("--unit", [text])


def test_colours() -> None:
    assert parse_colour("--background", "#204060") == (32, 64, 96)
    assert parse_colour("--background", "FFffff") == (255, 255, 255)


@pytest.mark.parametrize("text", ["", "#", "#2040", "#20406080", "red", "#gg0000"])
def test_what_is_no_colour(text: str) -> None:
    with pytest.raises(InputError, match="--background: expected a colour, as #204060"):
        parse_colour("--background", text)


def test_finite_numbers() -> None:
    assert check_finite("--yaw", -5.0) == -5.0
    with pytest.raises(InputError, match="--yaw: expected a finite number, got inf"):
        check_finite("--yaw", float("inf"))


def test_amounts_by_region() -> None:
    texts = ["mouth:anger=0.4", "left_eye:joy=1", "mouth:joy=-0.1"]
    expected = {"mouth": {"anger": 0.4, "joy": -0.1}, "left_eye": {"joy": 1.0}}
    assert parse_regions("--region", texts) == expected
    assert parse_regions("--region", ["eyes:a=b=1", "eyes:a:b=2"]) == {"eyes": {"a=b": 1, "a:b": 2}}


@pytest.mark.parametrize("text", ["", "mouth=1", ":joy=1", "mouth:=1", "mouth:joy", "mouth:joy=x"])
def test_what_is_no_amount_in_a_region(text: str) -> None:
    with pytest.raises(InputError, match="--region: expected REGION:NAME=AMOUNT, as mouth:anger"):
        parse_regions("--region", [text])


def test_angles_come_in_radians() -> None:
    assert parse_angles("--gaze", "180,-90") == pytest.approx((3.14159265, -1.57079633))


@pytest.mark.parametrize("text", ["", "1", "1,2,3", "a,b", "1;2"])
def test_what_are_no_angles(text: str) -> None:
    with pytest.raises(InputError, match="--gaze: expected YAW,PITCH in degrees, as 10,-5"):
        parse_angles("--gaze", text)
    with pytest.raises(InputError, match="--gaze: expected a finite number, got nan"):
        parse_angles("--gaze", "nan,0")


def test_a_state_of_all_options() -> None:
    state = parse_state(["joy=0.6"], ["mouth:anger=0.4"], ["jawOpen=0.5"], "0,0")
    assert state == FaceState(
        {"mouth": {"anger": 0.4}, "face": {"joy": 0.6}}, {"jawOpen": 0.5}, Gaze()
    )
    assert parse_state(None, None, None, None) == FaceState()


def test_counts() -> None:
    assert [parse_count("-n", text) for text in (None, "none", "5")] == [None, 0, 5]


@pytest.mark.parametrize("text", ["", "0", "-1", "1.5", "many", "²", "9" * 5000])
def test_what_is_no_count(text: str) -> None:
    with pytest.raises(InputError, match="--expressions: expected a number from 1 up, or none"):
        parse_count("--expressions", text)
