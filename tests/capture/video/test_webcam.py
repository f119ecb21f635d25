"""A camera that delivers when the test says so: no timing, no hardware."""

from __future__ import annotations

from collections.abc import Iterator
from queue import Queue
from threading import Semaphore

import numpy as np
import pytest

from mien.arrays import Array
from mien.capture.video.webcam import Webcam, open_camera
from mien.errors import InputError


class Camera:
    """Stands in for cv2.VideoCapture."""

    def __init__(self, fps: float = 25.0) -> None:
        self.fps, self.released = fps, False
        self._pictures: Queue[int | None] = Queue()
        self._asked = Semaphore(0)

    def read(self) -> tuple[bool, Array]:
        self._asked.release()
        level = self._pictures.get()
        bgr = np.full((48, 64, 3), level or 0, np.uint8)
        bgr[..., 0] = 7
        return level is not None, bgr

    def get(self, prop: int, /) -> float:
        return self.fps

    def release(self) -> None:
        self.released = True

    def deliver(self, level: int | None) -> None:
        """Hand out a picture (None: fail)."""
        self._pictures.put(level)

    def settle(self, count: int) -> None:
        """Wait until the reader has asked so often: it is done with all pictures but the last."""
        for _ in range(count):
            self._asked.acquire()


class Ticks:
    """A clock that is a second later whenever it is asked."""

    def __init__(self) -> None:
        self.now = 99.0

    def __call__(self) -> float:
        self.now += 1
        return self.now


@pytest.fixture
def camera() -> Iterator[Camera]:
    camera = Camera()
    camera.deliver(1)
    yield camera
    camera.deliver(None)


def open_device(camera: Camera) -> Webcam:
    return Webcam(0, open_device=lambda number: camera, clock=Ticks(), timeout_s=30.0)


def test_properties_before_the_first_frame(camera: Camera) -> None:
    webcam = open_device(camera)
    assert (webcam.width, webcam.height, webcam.fps) == (64, 48, 25.0)


@pytest.mark.parametrize("stated", [0.0, -1.0, float("nan"), 180000.0])
def test_a_rate_that_is_none(camera: Camera, stated: float) -> None:
    camera.fps = stated
    assert open_device(camera).fps == 30.0


def test_the_newest_picture_comes_first(camera: Camera) -> None:
    webcam = open_device(camera)
    camera.deliver(10)
    camera.settle(3)
    frames = webcam.frames()
    first = next(frames)
    for level in (20, 30, 40):
        camera.deliver(level)
    camera.settle(3)
    second = next(frames)
    assert [int(frame.pixels().max()) for frame in (first, second)] == [10, 40]
    assert [frame.index for frame in (first, second)] == [0, 3]
    assert (first.seconds, second.seconds, second.taken - first.taken) == (0, 3, 3)
    assert webcam.dropped == 2


def test_a_reader_that_is_fast_enough_waits_for_every_picture(camera: Camera) -> None:
    webcam = open_device(camera)
    frames = webcam.frames()
    seen = [next(frames).index]
    for level in (20, 30, 40):
        camera.deliver(level)
        seen.append(next(frames).index)
    assert (seen, webcam.dropped) == ([0, 1, 2, 3], 0)


def test_pixels_are_rgb_and_may_be_reduced(camera: Camera) -> None:
    frame = next(open_device(camera).frames())
    assert frame.pixels()[0, 0].tolist() == [1, 1, 7]
    assert frame.pixels(max_side=32).shape == (24, 32, 3)
    assert frame.pixels(max_side=640).shape == (48, 64, 3)


def test_a_camera_that_is_pulled_out_ends_with_a_note(camera: Camera) -> None:
    webcam = open_device(camera)
    frames = webcam.frames()
    next(frames)
    camera.deliver(10)
    next(frames)
    camera.deliver(None)
    assert list(frames) == []
    assert webcam.notes == ["camera 0 stopped delivering after 2 pictures"]
    webcam.close()
    assert camera.released


def test_a_camera_that_hangs_ends_with_a_note(camera: Camera) -> None:
    webcam = open_device(camera)
    webcam._patience = 0.01
    assert len(list(webcam.frames())) == 1
    assert webcam.notes == ["camera 0 stopped delivering after 1 pictures"]


def test_close_releases_the_camera(camera: Camera) -> None:
    webcam = open_device(camera)
    webcam._patience = 0.01
    webcam.close()
    camera.deliver(10)
    webcam._thread.join()
    webcam.close()
    assert camera.released


def test_a_camera_without_pictures() -> None:
    dead = Camera()
    dead.deliver(None)
    expected = "camera 0: expected a camera that delivers pictures, got one that does not"
    with pytest.raises(InputError, match=expected):
        open_device(dead)
    assert dead.released


def test_no_such_camera(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match=r"camera 99: expected a camera that is connected.* none"):
        open_camera(99)
    assert capfd.readouterr() == ("", "")
