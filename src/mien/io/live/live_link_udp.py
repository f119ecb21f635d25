"""Live Link Face packets: what Epic's capture app sends to Unreal over UDP, one a frame.

All big-endian: version (a byte, 6); device and subject, each a length (int32) and UTF-8; the time,
as frame number (int32), part of a frame (float32) and frames a second as a fraction (two int32);
how many values (a byte, 61) and the values (float32): 52 face units, angles of head and eyes. Signs
and angles are those of the app's recordings (mien.io.live.live_link), the order is not: here left
comes before right in jawLeft, jawRight and in mouthLeft, mouthRight, as in Unreal's list of them.
"""

from __future__ import annotations

import struct
import uuid
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mien.errors import InputError
from mien.io.live.live_link import EYE_COLUMNS, HEAD_COLUMNS, TIMECODE_RATE, UNITS

LIVE_LINK_PORT = 11111
"""Where Unreal listens."""

PACKET_VERSION = 6

_SWAPPED = {"jawRight": "jawLeft", "jawLeft": "jawRight"}
_SWAPPED |= {"mouthRight": "mouthLeft", "mouthLeft": "mouthRight"}
NAMES = (*(_SWAPPED.get(name, name) for name in UNITS), *HEAD_COLUMNS, *EYE_COLUMNS)
"""The 61 values in the packet's order."""

_TIME = struct.Struct(">ifii")
_VALUES = struct.Struct(f">{len(NAMES)}f")
_MAX_NAME = 255


@dataclass(frozen=True)
class Packet:
    """One frame of one subject.

    Attributes:
        subject: the name under which Unreal lists it.
        seconds: its time; the app counts from midnight.
        values: by NAMES, radians and weights, as `live_link_values` gives them; none where the app
            saw no face.
        device: which phone; made from the subject unless given.
    """

    subject: str
    seconds: float
    values: Mapping[str, float]
    device: str = ""


def encode(packet: Packet) -> bytes:
    """The bytes of a packet; weights of units are clipped to 0 and 1, as far as the app's go.

    Raises:
        InputError: a subject or device of no or of too many bytes, a negative time, values that are
            not all 61.
    """
    if set(packet.values) != set(NAMES):
        raise InputError("values", f"the {len(NAMES)} of Live Link Face", len(packet.values))
    if not packet.seconds >= 0:
        raise InputError("seconds", "a time of 0 s or later", packet.seconds)
    ordered = [packet.values[name] for name in NAMES]
    weights, angles = ordered[: len(UNITS)], ordered[len(UNITS) :]
    device = packet.device or str(uuid.uuid5(uuid.NAMESPACE_URL, packet.subject)).upper()
    frame, thousandths = divmod(round(packet.seconds * TIMECODE_RATE * 1000), 1000)
    return b"".join(
        (
            bytes([PACKET_VERSION]),
            _text("device", device),
            _text("subject", packet.subject),
            _TIME.pack(frame, thousandths / 1000, TIMECODE_RATE, 1),
            bytes([len(NAMES)]),
            _VALUES.pack(*np.clip(weights, 0, 1), *angles),
        )
    )


def decode(data: bytes) -> Packet:
    """The packet that these bytes are.

    Raises:
        InputError: says what was expected at which byte.
    """
    reader = _Reader(data)
    (version,) = reader.take(1)
    reader.check(version == PACKET_VERSION, f"version {PACKET_VERSION}", version)
    device, subject = reader.text(), reader.text()
    frame, part, rate, divisor = _TIME.unpack(reader.take(_TIME.size))
    reader.check(rate > 0 and divisor > 0, "a frame rate above 0", f"{rate}/{divisor}")
    seconds = (frame + part) * divisor / rate
    # The app goes on sending without values while it sees no face.
    if reader.rest in (b"", b"\0"):
        return Packet(subject, seconds, {}, device)
    (count,) = reader.take(1)
    reader.check(count == len(NAMES), f"{len(NAMES)} values", count)
    values = _VALUES.unpack(reader.take(_VALUES.size))
    reader.check(not reader.rest, "its end", f"{len(reader.rest)} bytes more")
    return Packet(subject, seconds, dict(zip(NAMES, values, strict=True)), device)


@dataclass
class _Reader:
    """Reads bytes one after the other."""

    data: bytes
    position: int = 0

    @property
    def rest(self) -> bytes:
        return self.data[self.position :]

    def take(self, length: int) -> bytes:
        part = self.rest[:length]
        self.check(len(part) == length, f"{length} bytes", len(part))
        self.position += length
        return part

    def text(self) -> str:
        (length,) = struct.unpack(">i", self.take(4))
        self.check(0 <= length <= _MAX_NAME, f"a text of at most {_MAX_NAME} bytes", length)
        return self.take(length).decode(errors="replace")

    def check(self, valid: bool, expected: str, found: object) -> None:
        if not valid:
            raise InputError(f"Live Link packet at byte {self.position}", expected, found)


def _text(name: str, text: str) -> bytes:
    coded = text.encode()
    if not 0 < len(coded) <= _MAX_NAME:
        raise InputError(name, f"a name of 1 to {_MAX_NAME} bytes", f"{len(coded)} bytes")
    return struct.pack(">i", len(coded)) + coded
