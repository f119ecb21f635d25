from __future__ import annotations

import struct
import wave
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from clips import scored
from mien.arrays import Array
from mien.capture.detector import LandmarkDetector
from mien.capture.mediapipe_face import LOWER_LIP, UPPER_LIP, DetectedFace
from mien.capture.video import Video, pick_frames
from mien.errors import EstimationError, FileFormatError, InputError


def written(path: Path, frames: Sequence[Array], times: list[int] | None = None) -> Path:
    """A clip of 10 frames a second, or with the given times in tenths of a second."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"crf": "4", "g": "4"})
        stream.pix_fmt = "yuv420p"
        stream.height, stream.width = frames[0].shape[:2]
        for index, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
            frame.pts = index if times is None else times[index]
            frame.time_base = Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def grey(levels: Iterable[int]) -> list[Array]:
    return [np.full((48, 64, 3), level, np.uint8) for level in levels]


@pytest.fixture(scope="module")
def small(faces: dict[str, Array]) -> dict[str, Array]:
    return {
        side: cv2.resize(pixels, (300, 400), interpolation=cv2.INTER_AREA)
        for side, pixels in faces.items()
    }


def test_frames_come_in_order_with_their_times(tmp_path: Path) -> None:
    levels, times = [20, 60, 100, 140, 180], [0, 1, 5, 6, 20]
    video = Video(written(tmp_path / "a.mp4", grey(levels), times))
    frames = list(video.frames())
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    assert [frame.seconds for frame in frames] == pytest.approx([0, 0.1, 0.5, 0.6, 2.0])
    assert [frame.pixels().shape for frame in frames] == [(48, 64, 3)] * 5
    assert [frame.pixels().mean() for frame in frames] == pytest.approx(levels, abs=3)
    assert not video.notes


@pytest.mark.parametrize(
    ("matrix", "quarters"),
    # What right (x) and down (y) of the stored picture become: tkhd's a, b, c, d.
    [((0, 1, -1, 0), -1), ((-1, 0, 0, -1), 2), ((0, -1, 1, 0), 1)],
)
def test_rotation_flag(tmp_path: Path, matrix: tuple[int, ...], quarters: int) -> None:
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:24, :32], stored[:24, 32:], stored[24:, :32] = 230, 160, 80
    path = written(tmp_path / "a.mp4", [stored] * 3)
    a, b, c, d = (65536 * entry for entry in matrix)
    data = path.read_bytes()
    place = data.index(
        struct.pack(">9i", 65536, 0, 0, 0, 65536, 0, 0, 0, 1 << 30), data.index(b"tkhd")
    )
    turned = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data[:place] + turned + data[place + 36 :])
    pixels = next(Video(path).frames()).pixels()
    expected = np.rot90(stored, quarters).astype(int)
    assert pixels.shape == expected.shape
    assert np.median(np.abs(pixels - expected)) <= 4


def test_broken_half_way_keeps_what_was_decoded(tmp_path: Path, rng: np.random.Generator) -> None:
    noise = rng.integers(0, 256, (40, 48, 64, 3), dtype=np.uint8)
    path = written(tmp_path / "a.mkv", noise)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    video = Video(path)
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


def test_sharp_frames_of_both_poses_are_picked(
    tmp_path: Path, small: dict[str, Array], detector: LandmarkDetector
) -> None:
    blurred = {side: cv2.GaussianBlur(pixels, (0, 0), 1.5) for side, pixels in small.items()}
    path = written(
        tmp_path / "a.mp4",
        [*[blurred["left"]] * 2, small["left"], *[blurred["right"]] * 2, small["right"]],
    )
    seen: list[tuple[int, int]] = []
    picked = pick_frames(
        path, count=7, detector=detector, progress=lambda done, total: seen.append((done, total))
    )
    assert list(picked.expressions) == ["neutral"]
    photos = picked.expressions["neutral"]
    assert [photo.name for photo in photos] == ["frame_000002.png", "frame_000005.png"]
    assert np.abs(photos[0].pixels.astype(int) - small["left"]).mean() < 3
    assert picked.notes == ("2 of 6 judged frames chosen: the head turns by 44 degrees in them",)
    assert seen == sorted(seen)
    assert all(done <= total for done, total in seen)


PLAYED = {40: scored(), 80: scored(mouthSmile=0.9), 120: scored(jawOpen=0.7)}
"""What an actor does in grey frames."""


class Audience:
    """A detector that sees the actor in them."""

    def detect_fast(self, pixels: Array) -> DetectedFace | None:
        level = 40 * round(pixels.mean() / 40)
        if level not in PLAYED:
            return None
        points = np.random.default_rng(0).uniform(0, 48, size=(478, 3))
        points[UPPER_LIP] = points[LOWER_LIP]
        return DetectedFace(points, PLAYED[level], np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize(
    ("count", "names"),
    [(None, ["neutral", "smile", "open_mouth"]), (1, ["neutral", "smile"]), (0, ["neutral"])],
)
def test_expressions_are_picked_and_named(
    tmp_path: Path, count: int | None, names: list[str]
) -> None:
    path = written(tmp_path / "a.mp4", grey([40, 40, 200, 80, 40, 120]))
    picked = pick_frames(path, expressions=count, detector=Audience())
    assert list(picked.expressions) == names
    levels = {"neutral": 40, "smile": 80, "open_mouth": 120}
    for name, photos in picked.expressions.items():
        (photo,) = photos
        assert photo.pixels.mean() == pytest.approx(levels[name], abs=3)
    if count is None:
        assert picked.expressions["smile"][0].name == "frame_000003.png"
        assert picked.notes == (
            "1 of 5 judged frames chosen: the head turns by 0 degrees in them",
            "2 other expressions chosen: smile, open_mouth",
        )


def test_no_face_in_any_frame(tmp_path: Path, detector: LandmarkDetector) -> None:
    path = written(tmp_path / "a.mp4", grey([10, 20, 30]))
    with pytest.raises(EstimationError, match=r"a\.mp4: no face found in any of its frames"):
        pick_frames(path, detector=detector)
    with pytest.raises(InputError, match="count: expected a number above zero"):
        pick_frames(path, count=0, detector=detector)


def test_real_clip(shared: Path, detector: LandmarkDetector) -> None:
    clip = shared / "data/videos/single_face.mp4"
    photos = pick_frames(clip, count=3, detector=detector).expressions["neutral"]
    assert 1 <= len(photos) <= 3
    assert photos[0].size == (640, 360)
