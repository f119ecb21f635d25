"""Live Link Face packets: the app's bytes, read by another reader; what is sent comes back."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest

from mien.animate.channels import head_rotation
from mien.animate.timeline import Moment
from mien.errors import InputError
from mien.io.live.live_link import EYE_COLUMNS, HEAD_COLUMNS, UNITS, live_link_values
from mien.io.live.live_link_udp import NAMES, Packet, decode, encode
from mien.rig.state import FaceState, Gaze
from packets import UNREAL, as_unreal_reads


def packet(subject: str = "anna", seconds: float = 3725.5, **values: float) -> Packet:
    return Packet(subject, seconds, dict.fromkeys(NAMES, 0.0) | values)


def test_names_are_unreals_in_their_order() -> None:
    assert list(NAMES) == UNREAL
    assert set(NAMES) == {*UNITS, *HEAD_COLUMNS, *EYE_COLUMNS}


def test_another_reader_finds_what_was_sent(rng: np.random.Generator) -> None:
    values = {name: float(np.float32(rng.uniform(0, 1))) for name in UNITS}
    values |= {name: float(np.float32(rng.normal())) for name in (*HEAD_COLUMNS, *EYE_COLUMNS)}
    data = encode(packet(**values))
    device, subject, seconds, found = as_unreal_reads(data)
    assert (subject, found) == ("anna", values)
    assert seconds == pytest.approx(3725.5, abs=1e-5)
    # Readers exist that take 36 characters for granted, as the app's own device has.
    assert len(device) == 36
    assert len(data) == 1 + 4 + 36 + 4 + 4 + 16 + 1 + 61 * 4


def test_left_and_right_do_not_change_places() -> None:
    _, _, _, found = as_unreal_reads(encode(packet(jawLeft=0.25, mouthRight=0.5)))
    assert {name: value for name, value in found.items() if value} == {
        "jawLeft": 0.25,
        "mouthRight": 0.5,
    }


def test_units_go_from_0_to_1_and_angles_where_they_will() -> None:
    _, _, _, found = as_unreal_reads(encode(packet(jawOpen=-0.5, cheekPuff=1.5, HeadYaw=-1.5)))
    assert (found["jawOpen"], found["cheekPuff"], found["HeadYaw"]) == (0, 1, -1.5)


def test_a_moment_has_the_recordings_angles() -> None:
    turned = head_rotation(0.3, 0, 0) @ head_rotation(0, -0.2, 0) @ head_rotation(0, 0, 0.1)
    moment = Moment(0.0, FaceState(gaze=Gaze(0.2, 0.1)), turned, np.zeros(3))
    values = live_link_values(moment, {"jawOpen": 0.5})
    _, _, _, found = as_unreal_reads(encode(packet(**values)))
    assert found["jawOpen"] == 0.5
    assert [found[name] for name in HEAD_COLUMNS] == pytest.approx([-0.3, -0.2, -0.1])
    assert found["LeftEyeYaw"] == found["RightEyeYaw"] == pytest.approx(-0.2)
    assert found["LeftEyePitch"] == pytest.approx(-0.1)
    assert found["eyeLookOutLeft"] == found["eyeLookInRight"] > 0 == found["eyeLookInLeft"]


@pytest.mark.parametrize("seconds", [0.0, 1 / 120, 59.99999, 86399.999])
@pytest.mark.parametrize("subject", ["a", "Zoë", "x" * 255])
def test_a_packet_round_trips(subject: str, seconds: float) -> None:
    sent = packet(subject, seconds, tongueOut=0.125, HeadYaw=-1.5)
    back = decode(encode(sent))
    assert (back.subject, back.values) == (subject, sent.values)
    assert back.seconds == pytest.approx(seconds, abs=1e-5)
    assert decode(encode(back)) == replace(back, seconds=decode(encode(back)).seconds)


def test_the_same_subject_is_the_same_device() -> None:
    assert decode(encode(packet("a"))).device == decode(encode(packet("a"))).device
    assert decode(encode(packet("a"))).device != decode(encode(packet("b"))).device
    named = replace(packet(), device="phone")
    assert decode(encode(named)).device == "phone"


@pytest.mark.parametrize("end", [b"", b"\0"])
def test_a_packet_without_values_is_a_lost_face(end: bytes) -> None:
    data = encode(packet())
    lost = decode(data[: -1 - 61 * 4] + end)
    assert (lost.subject, lost.values) == ("anna", {})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (packet(""), "subject: expected a name of 1 to 255 bytes, got 0 bytes"),
        (packet("x" * 256), "subject: expected a name of 1 to 255 bytes, got 256 bytes"),
        (packet(seconds=-1.0), "seconds: expected a time of 0 s or later, got -1.0"),
        (packet(seconds=float("nan")), "seconds: expected a time of 0 s or later, got nan"),
        (Packet("a", 0.0, {}), "values: expected the 61 of Live Link Face, got 0"),
    ],
)
def test_what_cannot_be_sent(given: Packet, message: str) -> None:
    with pytest.raises(InputError) as caught:
        encode(given)
    assert str(caught.value) == message


GOOD = encode(packet())
RATE = len(GOOD) - 61 * 4 - 9


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "at byte 0: expected 1 bytes, got 0"),
        (b"\5" + GOOD[1:], "at byte 1: expected version 6, got 5"),
        (GOOD[:3], "at byte 1: expected 4 bytes, got 2"),
        (GOOD[:1] + b"\xff" * 4 + GOOD[5:], "at byte 5: expected a text of at most 255 bytes"),
        (GOOD[:20], "at byte 5: expected 36 bytes, got 15"),
        (GOOD[:RATE] + struct.pack(">i", 0) + GOOD[RATE + 4 :], "expected a frame rate above 0"),
        (GOOD[:-244] + GOOD[-240:], "expected 244 bytes, got 240"),
        (GOOD[:-245] + b"\x34" + GOOD[-244:], "expected 61 values, got 52"),
        (GOOD + b"!", "expected its end, got 1 bytes more"),
    ],
)
def test_what_is_no_packet(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match="Live Link packet at byte") as caught:
        decode(data)
    assert message in str(caught.value)
