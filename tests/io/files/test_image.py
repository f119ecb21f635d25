from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.errors import FileFormatError, InputError
from mien.io.files.image import encode_image, image_kind, load_image, save_image


def picture(rng: np.random.Generator, channels: int = 3) -> np.ndarray:
    return rng.integers(0, 256, (13, 17, channels), dtype=np.uint8)


@pytest.mark.parametrize("channels", [3, 4])
def test_png_is_exact(tmp_path: Path, rng: np.random.Generator, channels: int) -> None:
    pixels = picture(rng, channels)
    save_image(tmp_path / "x.png", pixels)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "x.png")), pixels)


def test_jpeg_keeps_full_colour_resolution(tmp_path: Path) -> None:
    stripes = np.zeros((16, 16, 3), np.uint8)
    stripes[:, ::2], stripes[:, 1::2] = (200, 60, 60), (60, 60, 200)
    save_image(tmp_path / "x.jpg", stripes)
    assert np.abs(load_image(tmp_path / "x.jpg").astype(int) - stripes).max() < 30


def test_load_gives_three_channels(tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = picture(rng)
    save_image(tmp_path / "x.png", pixels)
    np.testing.assert_array_equal(load_image(tmp_path / "x.png"), pixels)


def test_transparency_has_no_place_in_a_jpeg(tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = picture(rng, 4)
    with pytest.raises(InputError, match=r"expected a \.png for a picture with transparency"):
        save_image(tmp_path / "x.jpg", pixels)
    pixels[..., 3] = 255
    save_image(tmp_path / "x.jpg", pixels)
    assert load_image(tmp_path / "x.jpg").shape == (13, 17, 3)


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_the_same_pixels_give_the_same_bytes(rng: np.random.Generator, kind: str) -> None:
    pixels = picture(rng)
    assert encode_image(pixels, kind) == encode_image(pixels.copy(), kind)


def test_unknown_suffixes_are_refused() -> None:
    assert [image_kind(name) for name in ("a.PNG", "a.jpg", "a.JPEG")] == ["PNG", "JPEG", "JPEG"]
    with pytest.raises(InputError, match=r"ends in \.png, \.jpg, \.jpeg, got \.bmp"):
        image_kind("a.bmp")
    with pytest.raises(InputError, match="got no suffix"):
        image_kind("a")


@pytest.mark.parametrize(
    "pixels", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 2), np.uint8), np.zeros((4, 4, 3))]
)
def test_what_is_no_picture_is_refused(tmp_path: Path, pixels: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"pixels: expected an \(h, w, 3 or 4\) uint8 image"):
        save_image(tmp_path / "x.png", pixels)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_image_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    with pytest.raises(FileFormatError, match=r"x\.png: there is no such file"):
        load_image(tmp_path / "x.png")
    with pytest.raises(FileFormatError, match=r"x\.png: .* that can be read, found File name"):
        load_image(tmp_path / ("x" * 300) / "x.png")  # A place that cannot be looked into.
    (tmp_path / "x.png").write_text("text")
    with pytest.raises(FileFormatError, match=r"x\.png: expected an image .*, found a text file"):
        load_image(tmp_path / "x.png")
    (tmp_path / "x.png").write_bytes(encode_image(picture(rng), "PNG")[:-200])
    with pytest.raises(FileFormatError, match=r"x\.png: expected a whole image, found a damaged"):
        load_image(tmp_path / "x.png")
