"""Only images of the kinds that are read are opened, and nothing that could wait or run."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.capture.images.opening import FORMATS, open_image
from mien.capture.images.photos import load_photo
from mien.capture.video.video import Video
from mien.errors import FileFormatError, InputError
from mien.io.files.image import load_image

EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 200 200\n"
LOOP = EPS + b"{ } loop\n"
RUNS = EPS + b"(ran) (w) file closefile\n%%EOF\n"
WMF = b"\xd7\xcd\xc6\x9a\0\0" + bytes(8) + b"\x60\0" + bytes(40)


def no_image(path: Path) -> None:
    for read in (load_photo, load_image):
        with pytest.raises(
            FileFormatError, match=rf"{path.name}: expected an image .* found (some|a \.eps)"
        ):
            read(path)


@pytest.mark.parametrize("content", [LOOP, RUNS, WMF])
@pytest.mark.parametrize("name", ["a.jpg", "a.eps", "a"])
def test_what_runs_a_program_is_no_image(
    tmp_path: Path, name: str, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    no_image(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert capfd.readouterr() == ("", "")


def test_the_handed_postscript(shared: Path) -> None:
    for folder in ("photos", "photos_loop"):
        no_image(shared / "data/cases/eps_photo" / folder / "c.jpg")


def test_every_kind_that_is_read_is_known_to_pillow(tmp_path: Path) -> None:
    Image.new("L", (2, 2)).save(tmp_path / "a.png")
    with open_image(tmp_path / "a.png", []):
        assert set(FORMATS) <= set(Image.OPEN)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"a\.jpg: expected a photo, got a named pipe"):
        load_photo(tmp_path / "a.jpg")
    with pytest.raises(FileFormatError, match=r"a\.jpg: expected an image, found a named pipe"):
        load_image(tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"a\.jpg: expected a video, got a named pipe"):
        Video(tmp_path / "a.jpg").info()


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="no sockets among files here")
def test_a_socket_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("a.jpg")
        with pytest.raises(InputError, match=r"a\.jpg: expected a photo, got a socket"):
            load_photo(tmp_path / "a.jpg")


def test_a_device_is_refused() -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("no devices among files here")
    with pytest.raises(InputError, match="/dev/zero: expected a photo, got a device"):
        load_photo("/dev/zero")


@pytest.mark.parametrize(("path", "found"), [("", "an empty name"), ("a\0b", "holds a NUL")])
def test_names_that_name_nothing(path: str, found: str) -> None:
    with pytest.raises(InputError, match=f"expected a photo, got .*{found}"):
        load_photo(path)


def test_a_picture_painted_with_16_bits_keeps_its_greys(tmp_path: Path) -> None:
    eight = np.arange(240, dtype=np.uint8).reshape(12, 20)
    Image.fromarray(eight.astype(np.uint16) * 257).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load_image(tmp_path / "a.png")[..., 0], eight)


def test_camera_raw_in_a_tiff_is_no_photo(tmp_path: Path) -> None:
    Image.new("RGB", (16, 12)).save(tmp_path / "a.dng", "TIFF")
    with pytest.raises(FileFormatError, match=r"a\.dng: expected an image .*camera RAW: export as"):
        load_photo(tmp_path / "a.dng")
