"""Streams: addresses that people type, packets that arrive on this computer."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import numpy as np
import pytest

from mien.animate.channels import head_rotation
from mien.animate.timeline import Moment
from mien.errors import InputError
from mien.pipelines.tracking.streams import Stream, StreamAddress, parse_stream
from mien.rig.state import FaceState
from packets import as_unreal_reads, listening, messages, port_of

MOMENT = Moment(2.0, FaceState({"mouth": {"joy": 0.5}}), head_rotation(0.3, 0, 0), np.zeros(3))


@pytest.fixture
def receiver() -> Iterator[socket.socket]:
    with listening() as receiver:
        yield receiver


def units_of(state: FaceState) -> dict[str, float]:
    return {"mouthSmileLeft": state.expressions["mouth"]["joy"]}


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("livelink://127.0.0.1:11111", StreamAddress("livelink", "127.0.0.1", 11111)),
        ("livelink://", StreamAddress("livelink", "127.0.0.1", 11111)),
        ("livelink://10.0.0.9/anna", StreamAddress("livelink", "10.0.0.9", 11111, "anna")),
        ("vmc://studio:39540", StreamAddress("vmc", "studio", 39540)),
        ("vmc://:39540/", StreamAddress("vmc", "127.0.0.1", 39540)),
        ("VMC://[::1]", StreamAddress("vmc", "::1", 39539)),
    ],
)
def test_addresses(text: str, address: StreamAddress) -> None:
    assert parse_stream(text) == address
    assert parse_stream(str(address)).port == address.port
    assert parse_stream(str(address)).host == address.host


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("127.0.0.1:11111", "127.0.0.1:11111"),
        ("localhost:11111", "localhost:11111"),
        ("osc://127.0.0.1", "osc://127.0.0.1"),
        ("vmc://127.0.0.1/anna", "vmc://127.0.0.1/anna"),
        ("vmc://me@127.0.0.1", "vmc://me@127.0.0.1"),
        ("vmc://127.0.0.1?a=b", "vmc://127.0.0.1?a=b"),
        ("vmc://127.0.0.1:port", "port"),
        ("vmc://127.0.0.1:70000", "Port out of range"),
        ("vmc://[::1", "Invalid IPv6"),
        ("", ""),
    ],
)
def test_no_addresses(text: str, found: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_stream(text)
    message = str(caught.value)
    assert message.startswith("--stream: expected livelink://HOST:PORT or vmc://HOST:PORT, got")
    assert found in message


def test_port_0_is_none() -> None:
    with pytest.raises(InputError, match="--stream: expected a port from 1 to 65535, got 0"):
        parse_stream("vmc://127.0.0.1:0")


def test_live_link_arrives(receiver: socket.socket) -> None:
    address = parse_stream(f"livelink://127.0.0.1:{port_of(receiver)}/anna")
    stream = Stream(address, units_of)
    stream.send(MOMENT, 2.0)
    _, subject, seconds, values = as_unreal_reads(receiver.recv(2048))
    assert subject == "anna"
    assert 2 <= seconds <= 24 * 3600 + 3
    assert values["mouthSmileLeft"] == 0.5
    assert values["HeadYaw"] == pytest.approx(-0.3)
    stream.close()
    assert stream.notes == []


def test_vmc_arrives_and_reports_a_lost_face(receiver: socket.socket) -> None:
    stream = Stream(parse_stream(f"vmc://127.0.0.1:{port_of(receiver)}"), units_of)
    stream.send(MOMENT, 2.0)
    stream.send(None, 2.5)
    found = [messages(receiver.recv(65536)) for _ in range(2)]
    assert ("/VMC/Ext/Blend/Val", ["mouth.joy", 0.5]) in found[0]
    assert ("/VMC/Ext/Blend/Val", ["MouthSmileLeft", 0.5]) in found[0]
    assert found[0][1] == ("/VMC/Ext/T", [2.0])
    assert found[1] == [("/VMC/Ext/OK", [1, 3, 0, 0]), ("/VMC/Ext/T", [2.5])]
    stream.close()


def test_live_link_is_silent_while_the_face_is_lost(receiver: socket.socket) -> None:
    address = parse_stream(f"livelink://127.0.0.1:{port_of(receiver)}")
    stream = Stream(address, units_of)
    stream.send(None, 1.0)
    stream.send(MOMENT, 2.0)
    assert as_unreal_reads(receiver.recv(2048))[3]["mouthSmileLeft"] == 0.5
    stream.close()


@pytest.mark.parametrize("protocol", ["vmc", "livelink"])
def test_a_receiver_that_does_not_listen_is_no_error(
    receiver: socket.socket, protocol: str
) -> None:
    port = port_of(receiver)
    receiver.close()
    stream = Stream(StreamAddress(protocol, "127.0.0.1", port), units_of)
    for second in range(3):
        stream.send(MOMENT, second)
    assert stream.notes == []
    stream.close()


def test_packets_that_cannot_be_sent_are_counted(receiver: socket.socket) -> None:
    stream = Stream(StreamAddress("vmc", "127.0.0.1", port_of(receiver)), units_of)
    stream.close()
    stream.send(MOMENT, 0.0)
    stream.send(None, 0.1)
    (note,) = stream.notes
    assert note.startswith(f"vmc://127.0.0.1:{port_of(receiver)}: 2 packets could not be sent (")


@pytest.mark.parametrize("host", ["no.such.host.invalid", "a..b"])
def test_a_host_that_cannot_be_found(host: str) -> None:
    with pytest.raises(
        InputError, match=f"--stream: expected a host that can be found, got {host}"
    ):
        Stream(StreamAddress("vmc", host, 39539), units_of)


def test_a_subject_that_is_too_long_is_refused_before_tracking() -> None:
    with pytest.raises(InputError, match="subject: expected a name of 1 to 255 bytes"):
        Stream(StreamAddress("livelink", "127.0.0.1", 11111, "x" * 300), units_of)
