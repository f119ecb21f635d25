from __future__ import annotations

import threading
from collections import deque
from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest

from filmed import broken, flagged, grey, written
from mien.capture.video.frames_ahead import AHEAD, frames_ahead, read_ahead
from mien.capture.video.video import Video
from mien.errors import FileFormatError, InputError


class Counting:
    """Counts on, and notes how far it came and whether it was closed."""

    def __init__(self, count: int, *, error: Exception | None = None) -> None:
        self.count, self.error = count, error
        self.begun, self.closed = 0, False

    def items(self) -> Generator[int]:
        try:
            for item in range(self.count):
                self.begun += 1
                yield item
            if self.error:
                raise self.error
        finally:
            self.closed = True


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Generator[None]:
    before = threading.active_count()
    yield
    assert threading.active_count() == before


@pytest.mark.parametrize("count", [0, 1, 3, 50])
def test_all_come_in_order(count: int) -> None:
    source = Counting(count)
    with read_ahead(source.items(), 4) as items:
        assert list(items) == list(range(count))
    assert source.closed


def test_taken_ahead_but_no_further() -> None:
    source = Counting(50)
    with read_ahead(source.items(), 3) as items:
        for item in items:
            assert source.begun <= item + 1 + 3
    assert source.begun == 50


def test_they_are_taken_beside_what_the_block_does() -> None:
    taken = threading.Event()

    def items() -> Generator[int]:
        yield 0
        taken.set()
        yield 1

    with read_ahead(items(), 2) as ahead:
        assert next(ahead) == 0
        assert taken.wait(10), "the second is taken while the first is looked at"


def test_an_error_comes_in_its_turn() -> None:
    source = Counting(5, error=InputError("clip", "a", "b"))
    seen: list[int] = []
    with pytest.raises(InputError, match="clip"), read_ahead(source.items(), 4) as items:
        seen.extend(items)
    assert seen == [0, 1, 2, 3, 4]
    assert source.closed


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_an_early_end_closes_the_source(error: type[BaseException]) -> None:
    source = Counting(1000)

    def stop_at(item: int) -> None:
        if item == 5:
            raise error

    with pytest.raises(error), read_ahead(source.items(), 4) as items:
        deque(map(stop_at, items))
    assert source.closed
    assert source.begun <= 11


def test_nothing_is_taken_from_it() -> None:
    source = Counting(5)
    with read_ahead(source.items(), 4):
        pass
    assert source.begun == 0


def test_pictures_of_a_video(tmp_path: Path) -> None:
    levels = list(range(20, 200, 10))
    video = Video(flagged(written(tmp_path / "a.mp4", grey(levels)), 1))
    with frames_ahead(video, start=3, max_side=32) as pictures:
        seen = list(pictures)
    assert [picture.frame for picture in seen] == list(range(3, 18))
    assert [picture.seconds for picture in seen] == pytest.approx(np.arange(3, 18) / 10)
    assert [picture.pixels.mean() for picture in seen] == pytest.approx(levels[3:], abs=3)
    assert {picture.pixels.shape for picture in seen} == {(32, 24, 3)}


def test_what_is_no_video(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_text("no video")
    with (
        pytest.raises(FileFormatError, match="expected a video, found a text file"),
        frames_ahead(Video(tmp_path / "a.mp4")) as pictures,
    ):
        next(pictures)


def test_broken_half_way(tmp_path: Path, rng: np.random.Generator) -> None:
    noise = rng.integers(0, 256, (40, 48, 64, 3), dtype=np.uint8)
    video = Video(broken(written(tmp_path / "a.mkv", noise)))
    with frames_ahead(video) as pictures:
        count = len(list(pictures))
    assert AHEAD < count < 40
    assert len(video.notes) == 1
