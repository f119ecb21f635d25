from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest

from mien.errors import InputError
from mien.io.files import video
from mien.io.files.video import save_video

COLORS = np.array([[200, 40, 30], [30, 160, 60], [40, 60, 190], [224, 172, 145]], np.uint8)


def frames(count: int, height: int = 64, width: int = 96) -> Iterator[np.ndarray]:
    """Quadrants of plain colours that change places from frame to frame."""
    for index in range(count):
        corners = np.roll(COLORS, index, axis=0).reshape(2, 2, 3)
        whole = corners.repeat(-(-height // 2), axis=0).repeat(-(-width // 2), axis=1)
        yield whole[:height, :width]


def read(path: Path) -> list[np.ndarray]:
    with av.open(path) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


@pytest.mark.parametrize(("suffix", "codec"), [(".mp4", "h264"), (".webm", "vp9")])
def test_frames_round_trip(tmp_path: Path, suffix: str, codec: str) -> None:
    path = tmp_path / f"clip{suffix}"
    assert save_video(path, frames(7), 25) == 7
    with av.open(path) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == (codec, 96, 64)
        assert (stream.format.name, stream.average_rate) == ("yuv420p", 25)
        context = stream.codec_context
        assert (context.colorspace, context.color_range) == (1, 1)
    found = read(path)
    assert len(found) == 7
    for actual, expected in zip(found, frames(7), strict=True):
        inner = np.ix_([8, 24, 40, 56], [12, 36, 60, 84])
        difference = np.abs(actual[inner].astype(int) - expected[inner])
        assert difference.max() <= 6, "colours are kept: the matrix that was used was declared"


@pytest.mark.parametrize(("height", "width"), [(63, 96), (64, 95), (63, 95)])
def test_odd_sides_are_made_even(tmp_path: Path, height: int, width: int) -> None:
    save_video(tmp_path / "clip.mp4", frames(2, height, width), 25)
    assert read(tmp_path / "clip.mp4")[0].shape == (64, 96, 3)


def test_ntsc_rates_are_kept(tmp_path: Path) -> None:
    save_video(tmp_path / "clip.mp4", frames(3), 29.97)
    with av.open(tmp_path / "clip.mp4") as container:
        assert float(container.streams.video[0].average_rate) == pytest.approx(29.97, abs=1e-3)


def test_an_mp4_has_its_index_before_its_pictures(tmp_path: Path) -> None:
    save_video(tmp_path / "clip.mp4", frames(3), 25)
    data = (tmp_path / "clip.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_the_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    for name in "ab":
        save_video(tmp_path / f"{name}.mp4", frames(5), 25)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_broken_stream_of_frames_leaves_the_old_video(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"old")

    def broken() -> Iterator[np.ndarray]:
        yield from frames(3)
        raise RuntimeError("the renderer stopped")

    with pytest.raises(RuntimeError, match="renderer stopped"):
        save_video(path, broken(), 25)
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["clip.mp4"]


def test_no_frames(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected at least one frame to write, got none"):
        save_video(tmp_path / "clip.mp4", [], 25)
    assert list(tmp_path.iterdir()) == []


def test_a_frame_of_another_size_is_named(tmp_path: Path) -> None:
    mixed = [*frames(2), *frames(1, 32, 32)]
    with pytest.raises(InputError, match="frame 2: expected 96x64 px as the first, got 32x32 px"):
        save_video(tmp_path / "clip.mp4", mixed, 25)


def test_a_frame_that_is_no_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"frame 0: expected an \(h, w, 3\) uint8 image"):
        save_video(tmp_path / "clip.mp4", [np.zeros((8, 8))], 25)


@pytest.mark.parametrize("fps", [0, -25, float("nan")])
def test_a_rate_above_zero(tmp_path: Path, fps: float) -> None:
    with pytest.raises(InputError, match="fps: expected a number above zero"):
        save_video(tmp_path / "clip.mp4", frames(1), fps)


def test_an_unknown_suffix(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a name that ends in \.mp4 or \.webm, got \.avi"):
        save_video(tmp_path / "clip.avi", frames(1), 25)


def test_a_missing_encoder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(video._ENCODERS, ".mp4", ("h264_of_nobody", "h264_of_none"))
    with pytest.raises(InputError, match="PyAV with the encoder h264_of_nobody or h264_of_none"):
        save_video(tmp_path / "clip.mp4", frames(1), 25)


def read_alpha(path: Path) -> list[np.ndarray]:
    """Frames by libvpx's own decoder: FFmpeg's built-in one leaves alpha out."""
    decoder = av.CodecContext.create("libvpx-vp9", "r")
    with av.open(path) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
        found = [frame for packet in packets for frame in decoder.decode(packet)]
    return [frame.to_ndarray(format="rgba") for frame in found]


def test_alpha_comes_back_from_a_webm(tmp_path: Path) -> None:
    ramp = np.linspace(0, 255, 96).astype(np.uint8)
    given = [
        np.dstack([frame, np.tile(np.roll(ramp, 8 * i), (64, 1))])
        for i, frame in enumerate(frames(7))
    ]
    assert save_video(tmp_path / "clip.webm", iter(given), 25) == 7
    with av.open(tmp_path / "clip.webm") as container:
        assert container.streams.video[0].metadata["alpha_mode"] == "1", "for browsers"
    found = read_alpha(tmp_path / "clip.webm")
    assert len(found) == 7
    for actual, expected in zip(found, given, strict=True):
        difference = np.abs(actual[..., 3].astype(int) - expected[..., 3])
        assert np.median(difference) <= 2
        assert np.mean(difference > 12) < 0.05, "but for the step from opaque to clear"
    seen = read(tmp_path / "clip.webm")[0]
    assert np.abs(seen[8, 12].astype(int) - given[0][8, 12, :3]).max() <= 6


def test_alpha_needs_a_webm(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"clip\.mp4: expected a \.webm for pictures with alpha"):
        save_video(tmp_path / "clip.mp4", [np.zeros((8, 8, 4), np.uint8)], 25)
    mixed = [np.zeros((8, 8, 4), np.uint8), np.zeros((8, 8, 3), np.uint8)]
    with pytest.raises(InputError, match=r"frame 1: expected 8x8 px with alpha as the first"):
        save_video(tmp_path / "clip.webm", mixed, 25)
