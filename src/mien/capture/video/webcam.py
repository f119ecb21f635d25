"""A camera of this computer, newest picture first."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.images.photos import downscale
from mien.capture.video.live_source import LiveFrame
from mien.errors import InputError

TIMEOUT_S = 10.0
"""Seconds without a picture after which a camera has stopped; some take long to start."""
_USUAL_RATE = 30.0


class CaptureDevice(Protocol):
    """The methods of cv2.VideoCapture that are used."""

    def read(self) -> tuple[bool, UInt8[Array, "h w 3"]]:
        """Whether there is a picture, and the picture, BGR."""

    def get(self, prop: int, /) -> float:
        """A property such as the rate."""

    def release(self) -> None:
        """Release the device."""


@dataclass(frozen=True)
class _BgrPicture:
    """A picture as OpenCV delivers it."""

    bgr: UInt8[Array, "h w 3"]

    def pixels(self, *, max_side: int | None = None) -> UInt8[Array, "h w 3"]:
        small = self.bgr if max_side is None else downscale(self.bgr, max_side)
        return np.ascontiguousarray(small[..., ::-1])


def open_camera(number: int) -> CaptureDevice:
    """Camera 0, 1, … of this computer. Raises: InputError: there is none, or no access."""
    import cv2

    log = cv2.utils.logging
    before = log.getLogLevel()
    log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        capture: CaptureDevice = cv2.VideoCapture(number)
        if capture.isOpened():  # type: ignore[attr-defined]
            return capture
    finally:
        log.setLogLevel(before)
    expected = "a camera that is connected, free and allowed for this program"
    raise InputError(f"camera {number}", expected, "none")


class Webcam:
    """A camera that is read by a thread, which keeps the newest picture only.

    A tracker that is slower than the camera misses pictures but never falls behind.

    Args:
        number: 0 is the system's first.
        open_device: opens the camera.
        clock: gives the time in seconds.
        timeout_s: seconds without a picture after which the camera counts as stopped.

    Raises:
        InputError: no such camera, or none that delivers pictures.
    """

    def __init__(
        self,
        number: int,
        *,
        open_device: Callable[[int], CaptureDevice] = open_camera,
        clock: Callable[[], float] = time.monotonic,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self._name, self._clock, self._timeout_s = f"camera {number}", clock, timeout_s
        self.dropped = 0
        self.notes: list[str] = []
        self._newest: LiveFrame | None = None
        self._changed, self._ended = threading.Condition(), False
        capture = open_device(number)
        self.fps = _rate(capture)
        # A daemon, so that a driver that hangs cannot keep the program from ending.
        self._thread = threading.Thread(target=self._read, args=(capture,), daemon=True)
        self._thread.start()
        first = self._newer_than(-1)
        if first is None:
            self.close()
            raise InputError(self._name, "a camera that delivers pictures", "one that does not")
        self.height, self.width = first.pixels().shape[:2]

    def frames(self) -> Generator[LiveFrame]:
        """The newest picture whenever one is asked for; they end, with a note, when it stops."""
        begin = before = None
        while (frame := self._newer_than(-1 if before is None else before.index)) is not None:
            begin = begin or frame
            if before is not None:
                self.dropped += frame.index - before.index - 1
            before = frame
            seconds = frame.taken - begin.taken
            yield replace(frame, index=frame.index - begin.index, seconds=seconds)
        count = 0 if begin is None or before is None else before.index - begin.index + 1
        self.notes.append(f"{self._name} stopped delivering after {count} pictures")

    def close(self) -> None:
        """Release the camera; a second time does nothing."""
        with self._changed:
            self._ended = True
        self._thread.join(self._timeout_s)

    def _read(self, capture: CaptureDevice) -> None:
        """The thread's loop. All calls of the camera are here, as it is not safe to share."""
        try:
            while not self._ended:
                there, bgr = capture.read()
                if not there:
                    break
                taken = self._clock()
                with self._changed:
                    index = self._last_index() + 1
                    self._newest = LiveFrame(index, 0.0, taken, _BgrPicture(bgr))
                    self._changed.notify_all()
        finally:
            capture.release()
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _last_index(self) -> int:
        return -1 if self._newest is None else self._newest.index

    def _newer_than(self, index: int) -> LiveFrame | None:
        """The newest picture once there is one after this; None: none comes any more."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._ended or self._last_index() > index, self._timeout_s
            )
            return self._newest if self._last_index() > index else None


def _rate(capture: CaptureDevice) -> float:
    """Frames a second as the driver states them; many state nothing."""
    import cv2

    stated = float(capture.get(cv2.CAP_PROP_FPS))
    return stated if 1 <= stated <= 1000 else _USUAL_RATE
