from __future__ import annotations

import wave
from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from PIL import Image

from filmed import broken, flagged, grey, shown_by, written
from mien.arrays import Array
from mien.capture.video.video import Video, VideoInfo
from mien.errors import FileFormatError, InputError


def test_frames_come_in_order_with_their_times(tmp_path: Path) -> None:
    levels, times = [20, 60, 100, 140, 180], [0, 1, 5, 6, 20]
    video = Video(written(tmp_path / "a.mp4", grey(levels), times))
    frames = list(video.frames())
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    assert [frame.seconds for frame in frames] == pytest.approx([0, 0.1, 0.5, 0.6, 2.0])
    assert [frame.pixels().shape for frame in frames] == [(48, 64, 3)] * 5
    assert [frame.pixels().mean() for frame in frames] == pytest.approx(levels, abs=3)
    assert not video.notes


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_what_a_file_states(tmp_path: Path, suffix: str) -> None:
    video = Video(written(tmp_path / f"a.{suffix}", grey([20, 60, 100, 140])))
    assert video.info() == VideoInfo(64, 48, fps=10, frames=4, seconds=0.4)


def test_times_count_from_the_beginning(tmp_path: Path) -> None:
    video = Video(written(tmp_path / "a.mts", grey([20, 60, 100]), [30, 31, 33]))
    assert [frame.seconds for frame in video.frames()] == pytest.approx([0, 0.1, 0.3])


def test_a_clip_that_changes_its_size_keeps_the_first(
    tmp_path: Path, faces: dict[str, Array]
) -> None:
    large = written(tmp_path / "large.mts", [cv2.resize(faces["left"], (300, 400))] * 3)
    small = written(tmp_path / "small.mts", [cv2.resize(faces["left"], (150, 200))] * 3)
    (tmp_path / "a.mts").write_bytes(large.read_bytes() + small.read_bytes())
    pictures = [frame.pixels().astype(int) for frame in Video(tmp_path / "a.mts").frames()]
    assert len(pictures) == 6
    for picture in pictures:
        assert picture.shape == (400, 300, 3)
        assert np.abs(picture - pictures[0]).mean() < 6


def test_metadata_that_are_not_utf8_stop_nothing(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mkv", grey([20, 60, 100]))
    data = path.read_bytes()
    # Matroska states who wrote the file at its head, which FFmpeg hands on as metadata.
    assert b"Lavf" in data
    path.write_bytes(data.replace(b"Lavf", b"L\xfcv\xff"))
    assert len(list(Video(path).frames())) == 3


@pytest.mark.parametrize("max_side", [320, 250])
def test_pictures_reduced_in_size(tmp_path: Path, faces: dict[str, Array], max_side: int) -> None:
    """As good as averaging the converted picture, and not shifted against it."""
    frame = next(Video(written(tmp_path / "a.mp4", [faces["left"]])).frames())
    full, small = frame.pixels(), frame.pixels(max_side=max_side)
    assert frame.size == (600, 800)
    assert small.shape == (max_side, round(0.75 * max_side), 3)
    averaged = cv2.resize(full, small.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(small.astype(int) - averaged).mean() < 1.5
    shift, _ = cv2.phaseCorrelate(averaged[..., 1].astype(float), small[..., 1].astype(float))
    assert np.abs(shift).max() < 0.02
    np.testing.assert_array_equal(frame.pixels(max_side=800), full)


@pytest.mark.parametrize("quarters", [-1, 2, 1])
def test_rotation_flag(tmp_path: Path, quarters: int) -> None:
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:24, :32], stored[:24, 32:], stored[24:, :32] = 230, 160, 80
    video = Video(flagged(written(tmp_path / "a.mp4", [stored] * 3), quarters))
    frame = next(video.frames())
    expected = np.rot90(stored, quarters).astype(int)
    for max_side, step in ((None, 1), (32, 2)):
        pixels = frame.pixels(max_side=max_side)
        assert pixels.shape == expected[::step, ::step].shape
        assert np.median(np.abs(pixels - expected[::step, ::step])) <= 4
    facts = video.info()
    assert (facts.height, facts.width) == expected.shape[:2]


@pytest.mark.parametrize(
    ("matrix", "shown"),
    [
        ((-1, 0, 0, 1), lambda stored: stored[:, ::-1]),
        ((1, 0, 0, -1), lambda stored: stored[::-1]),
        ((0, 1, 1, 0), lambda stored: stored.transpose(1, 0, 2)),
        ((0, -1, -1, 0), lambda stored: stored[::-1, ::-1].transpose(1, 0, 2)),
    ],
)
def test_a_matrix_that_mirrors(
    tmp_path: Path, matrix: tuple[int, int, int, int], shown: Callable[[Array], Array]
) -> None:
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:24, :32], stored[:24, 32:], stored[24:, :32] = 230, 160, 80
    video = Video(shown_by(written(tmp_path / "a.mp4", [stored] * 3), *matrix))
    frame = next(video.frames())
    expected = shown(stored).astype(int)
    for max_side, step in ((None, 1), (32, 2)):
        pixels = frame.pixels(max_side=max_side)
        assert pixels.shape == expected[::step, ::step].shape
        assert np.median(np.abs(pixels - expected[::step, ::step])) <= 4
    facts = video.info()
    assert (facts.height, facts.width) == expected.shape[:2]


@pytest.mark.parametrize(("name", "mirrored"), [("hflip.mp4", True), ("bottom_up.mp4", False)])
def test_the_handed_mirrored_clips(shared: Path, name: str, mirrored: bool) -> None:
    """Three seconds of a clip that is beside them: upright, one of both mirrored."""
    original = list(Video(shared / "data/videos/cap13_edit2.mp4").frames())[:75:25]
    frames = list(Video(shared / "data/cases/mirrored_clip" / name).frames())[::25]
    for frame, other in zip(frames, original, strict=True):
        expected = other.pixels()[:, ::-1] if mirrored else other.pixels()
        assert np.abs(frame.pixels().astype(int) - expected).mean() < 6


def test_pictures_stored_from_the_bottom_up(tmp_path: Path) -> None:
    """Raw .avi files do, and no flag says so: their kind does."""
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:24], stored[24:, :32] = (200, 40, 90), 120
    with av.open(str(tmp_path / "a.avi"), "w") as container:
        stream = container.add_stream("rawvideo", rate=10)
        stream.pix_fmt, stream.height, stream.width = "bgr24", 48, 64
        frame = av.VideoFrame.from_ndarray(stored, format="rgb24")
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    (frame,) = Video(tmp_path / "a.avi").frames()
    np.testing.assert_array_equal(frame.pixels(), stored)


def test_the_cover_of_a_song_is_no_video(tmp_path: Path) -> None:
    kinds = pytest.importorskip("av.stream")
    if not hasattr(kinds, "Disposition"):
        pytest.skip("this PyAV does not tell covers")
    with av.open(str(tmp_path / "a.m4a"), "w", format="mp4") as container:
        cover = container.add_stream("png", rate=1)
        cover.pix_fmt, cover.height, cover.width = "rgb24", 16, 16
        cover.disposition = kinds.Disposition.attached_pic.value
        container.mux(cover.encode(av.VideoFrame(16, 16, "rgb24")))
        container.mux(cover.encode())
    with pytest.raises(FileFormatError, match="expected a video, found no picture track"):
        Video(tmp_path / "a.m4a").info()


def test_broken_half_way_keeps_what_was_decoded(tmp_path: Path, rng: np.random.Generator) -> None:
    noise = rng.integers(0, 256, (40, 48, 64, 3), dtype=np.uint8)
    video = Video(broken(written(tmp_path / "a.mkv", noise)))
    assert 10 < len(list(video.frames())) < 30
    (note,) = video.notes
    assert "of the 40 frames that it states can be read" in note or "the stream breaks" in note


def test_not_a_video(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_text("no video\n" * 100)
    with pytest.raises(FileFormatError, match=r"a\.mp4: expected a video, found a text file"):
        list(Video(path).frames())
    path.write_bytes(b"")
    with pytest.raises(FileFormatError, match=r"a\.mp4: expected a video, found an empty file"):
        list(Video(path).frames())
    with pytest.raises(InputError, match=r"b\.mp4: expected a video, got no such file"):
        list(Video(tmp_path / "b.mp4").frames())


def test_truncated_before_its_index(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mp4", grey([1, 2, 3]))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(FileFormatError, match=r"a\.mp4: expected a video, found"):
        list(Video(path).frames())


def test_sound_only(tmp_path: Path) -> None:
    with wave.open(str(tmp_path / "a.wav"), "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(8000)
        sound.writeframes(bytes(1600))
    with pytest.raises(FileFormatError, match="expected a video, found no picture track"):
        list(Video(tmp_path / "a.wav").frames())


def test_no_frame_that_can_be_decoded(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mp4", grey([1, 2, 3]))
    data = path.read_bytes()
    begin = data.index(b"mdat") + 4
    end = data.index(b"moov") - 4
    path.write_bytes(data[:begin] + bytes(end - begin) + data[end:])
    with pytest.raises(FileFormatError, match=r"a\.mp4: expected a video, found no frame"):
        list(Video(path).frames())


@pytest.mark.parametrize("ending", ["jpg", "webp"])
def test_a_photo_is_named_as_one(tmp_path: Path, ending: str) -> None:
    Image.new("RGB", (8, 8)).save(tmp_path / f"a.{ending}")
    with pytest.raises(FileFormatError, match=rf"a\.{ending}: expected a video, found a photo$"):
        next(Video(tmp_path / f"a.{ending}").frames())
