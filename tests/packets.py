"""Packets of live tracking, read without mien, as the protocols describe them."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

# Unreal's EARFaceBlendShape, by number.
ENUM = (
    "eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft "
    "eyeWideLeft eyeBlinkRight eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight "
    "eyeSquintRight eyeWideRight jawForward jawLeft jawRight jawOpen mouthClose mouthFunnel "
    "mouthPucker mouthLeft mouthRight mouthSmileLeft mouthSmileRight mouthFrownLeft "
    "mouthFrownRight mouthDimpleLeft mouthDimpleRight mouthStretchLeft mouthStretchRight "
    "mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper mouthPressLeft mouthPressRight "
    "mouthLowerDownLeft mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight browDownLeft "
    "browDownRight browInnerUp browOuterUpLeft browOuterUpRight cheekPuff cheekSquintLeft "
    "cheekSquintRight noseSneerLeft noseSneerRight tongueOut HeadYaw HeadPitch HeadRoll LeftEyeYaw "
    "LeftEyePitch LeftEyeRoll RightEyeYaw RightEyePitch RightEyeRoll"
)
UNREAL = ENUM.split()


def as_unreal_reads(data: bytes) -> tuple[str, str, float, dict[str, float]]:
    """Device, subject, seconds and values, by fixed places."""
    assert data[0] == 6
    device, data = data[5 : 5 + data[4]], data[5 + data[4] :]
    length = int.from_bytes(data[:4], "big")
    subject, data = data[4 : 4 + length], data[4 + length :]
    frame, rate, divisor = (int.from_bytes(data[i : i + 4], "big") for i in (0, 8, 12))
    part = np.frombuffer(data[4:8], ">f4")[0]
    assert data[16] == 61
    values = dict(zip(UNREAL, np.frombuffer(data[17:], ">f4").tolist(), strict=True))
    return device.decode(), subject.decode(), (frame + float(part)) / rate * divisor, values


def messages(data: bytes) -> list[tuple[str, list[object]]]:
    """What an OSC bundle holds: texts padded to four bytes, numbers of four bytes."""
    assert data[:16] == b"#bundle\0" + bytes(7) + b"\1"
    found, place = [], 16
    while place < len(data):
        size = int.from_bytes(data[place : place + 4], "big")
        found.append(_message(data[place + 4 : place + 4 + size]))
        place += 4 + size
    assert place == len(data)
    return found


def blend_values(data: bytes) -> dict[str, float]:
    """What a bundle sets, by name; nothing twice."""
    found = [values for address, values in messages(data) if address == "/VMC/Ext/Blend/Val"]
    by_name = {str(name): float(str(value)) for name, value in found}
    assert len(by_name) == len(found)
    return by_name


def _message(data: bytes) -> tuple[str, list[object]]:
    address, data = _text(data)
    types, data = _text(data)
    values: list[object] = []
    for kind in types[1:]:
        if kind == "s":
            value, data = _text(data)
            values.append(value)
        else:
            values += struct.unpack(f">{kind}", data[:4])
            data = data[4:]
    assert not data
    return address, values


def _text(data: bytes) -> tuple[str, bytes]:
    end = data.index(0)
    return data[:end].decode(), data[end + 4 - end % 4 :]


@contextmanager
def listening() -> Iterator[socket.socket]:
    """A socket on this computer that packets can be sent to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        yield receiver


def port_of(receiver: socket.socket) -> int:
    return int(receiver.getsockname()[1])
