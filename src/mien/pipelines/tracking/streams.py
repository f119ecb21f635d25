"""Receivers of live tracking: `livelink://127.0.0.1:11111`, `vmc://192.168.0.7`."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Protocol
from urllib.parse import SplitResult, urlsplit

import numpy as np

from mien.animate.timeline import Moment
from mien.errors import InputError
from mien.io.live import live_link_udp, vmc
from mien.io.live.live_link import live_link_values
from mien.rig.state import FaceState

HOST, SUBJECT = "127.0.0.1", "mien"
PORTS = {"livelink": live_link_udp.LIVE_LINK_PORT, "vmc": vmc.VMC_PORT}

_AT_REST = Moment(0.0, FaceState(), np.eye(3), np.zeros(3))

UnitsOf = Callable[[FaceState], Mapping[str, float]]


@dataclass(frozen=True)
class StreamAddress:
    """The address of a receiver.

    Attributes:
        protocol: "livelink" or "vmc".
        host: its name or IP address.
        port: its UDP port.
        subject: the name under which Unreal lists a Live Link stream.
    """

    protocol: str
    host: str
    port: int
    subject: str = SUBJECT

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.protocol}://{host}:{self.port}"


def parse_stream(text: str) -> StreamAddress:
    """The address that a text states; this computer and the usual port unless given.

    Args:
        text: `livelink://HOST:PORT/SUBJECT` or `vmc://HOST:PORT`.

    Raises:
        InputError: neither, or no port.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise InputError("--stream", "livelink://HOST:PORT or vmc://HOST:PORT", error) from None
    subject = parts.path.strip("/")
    if parts.scheme not in PORTS or _has_extras(parts) or (subject and parts.scheme == "vmc"):
        raise InputError("--stream", "livelink://HOST:PORT or vmc://HOST:PORT", text)
    if port == 0:
        raise InputError("--stream", "a port from 1 to 65535", port)
    host = parts.hostname or HOST
    return StreamAddress(parts.scheme, host, port or PORTS[parts.scheme], subject or SUBJECT)


def _has_extras(parts: SplitResult) -> bool:
    """Whether an address has parts that mean nothing here."""
    return bool(parts.query or parts.fragment or "@" in parts.netloc)


class Encoder(Protocol):
    """One protocol's packets."""

    def encode_face(self, moment: Moment, units: Mapping[str, float]) -> bytes:
        """The packet of a face, with the weights of the units that stand for it."""

    def encode_lost(self, seconds: float) -> bytes | None:
        """The packet of a lost frame; None: nothing is sent."""


@dataclass(frozen=True)
class LiveLinkEncoder:
    """Packets of Live Link Face.

    Attributes:
        subject: the stream's name.
        start: seconds since midnight at time 0 of the moments.
    """

    subject: str
    start: float

    def encode_face(self, moment: Moment, units: Mapping[str, float]) -> bytes:
        """As Encoder.encode_face."""
        seconds, values = self.start + moment.time, live_link_values(moment, units)
        return live_link_udp.encode(live_link_udp.Packet(self.subject, seconds, values))

    def encode_lost(self, seconds: float) -> None:
        """As Encoder.encode_lost."""
        # Unreal keeps the last values and detects by itself that nothing new comes.
        return


@dataclass(frozen=True)
class VmcEncoder:
    """Bundles of the VMC protocol."""

    def encode_face(self, moment: Moment, units: Mapping[str, float]) -> bytes:
        """As Encoder.encode_face."""
        return vmc.encode_face(moment, units)

    def encode_lost(self, seconds: float) -> bytes:
        """As Encoder.encode_lost."""
        return vmc.encode_lost(seconds)


class Stream:
    """Packets to one receiver over UDP, which does not report whether they arrive.

    A packet that cannot be sent is counted and dropped.

    Args:
        address: of the receiver.
        units_of: the weights of units for a face state.

    Raises:
        InputError: a host that cannot be found, a subject that is too long.
    """

    def __init__(self, address: StreamAddress, units_of: UnitsOf) -> None:
        self.address, self._units_of = address, units_of
        self._encoder = _make_encoder(address)
        # The first packet is slow to encode, and raises InputError if the subject is too long.
        self._encoder.encode_face(_AT_REST, {})
        self._failed, self._reason = 0, ""
        family, self._target = _resolve(address)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, moment: Moment | None, seconds: float) -> None:
        """Send a frame.

        Args:
            moment: None where the face is lost.
            seconds: its time.
        """
        if moment is None:
            data = self._encoder.encode_lost(seconds)
        else:
            data = self._encoder.encode_face(moment, self._units_of(moment.state))
        try:
            if data is not None:
                self._socket.sendto(data, self._target)
        except OSError as error:
            self._failed += 1
            self._reason = error.strerror or str(error)

    @property
    def notes(self) -> list[str]:
        """For the user: how many packets could not be sent, if any."""
        if not self._failed:
            return []
        return [f"{self.address}: {self._failed} packets could not be sent ({self._reason})"]

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _make_encoder(address: StreamAddress) -> Encoder:
    if address.protocol == "vmc":
        return VmcEncoder()
    now = datetime.now()
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0)
    return LiveLinkEncoder(address.subject, (now - midnight).total_seconds())


def _resolve(address: StreamAddress) -> tuple[int, tuple]:
    """The address family and the socket address."""
    try:
        addresses = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        raise InputError("--stream", "a host that can be found", address.host) from None
    family, _, _, _, target = addresses[0]
    return family, target
