from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from mien.arrays import Array
from mien.capture.images.photos import load_photo
from mien.errors import FileFormatError, InputError

# D50-adapted colorants (rows X, Y, Z) of Display P3 and sRGB, as in their ICC profiles.
P3 = np.array(
    [[0.51512, 0.29198, 0.15710], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]]
)
SRGB = np.array(
    [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]]
)
GAMMA = 2.2


@pytest.fixture
def picture() -> Array:
    """A (30, 40, 3) picture without any symmetry."""
    ramp = np.linspace(0, 255, 30 * 40).reshape(30, 40)
    return np.dstack([ramp, ramp[::-1] * 0.5, np.full((30, 40), 90)]).astype(np.uint8)


def saved(pixels: Array, path: Path, **options: object) -> Path:
    Image.fromarray(pixels).save(path, **options)
    return path


def encoded(linear: Array) -> Array:
    """sRGB's transfer function, to 0..255."""
    low, high = 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    return 255 * np.where(linear <= 0.0031308, low, high)


def icc_profile(colorants: Array | None, name: str) -> bytes:
    """A minimal ICC v2 display profile with a plain gamma curve; of grey without colorants."""

    def xyz(values: Array) -> bytes:
        return b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(v * 65536) for v in values))

    curve = b"curv\0\0\0\0" + struct.pack(">IH2x", 1, round(GAMMA * 256))
    text = name.encode() + b"\0"
    description = b"desc\0\0\0\0" + struct.pack(">I", len(text)) + text + bytes(78)
    tags = {
        b"desc": description + bytes(-len(description) % 4),
        b"cprt": b"text\0\0\0\0none\0\0\0\0",
        b"wtpt": xyz(np.array([0.9642, 1.0, 0.8249])),
    }
    if colorants is None:
        tags[b"kTRC"] = curve
    else:
        tags |= {f"{letter}XYZ".encode(): xyz(colorants[:, i]) for i, letter in enumerate("rgb")}
        tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve)
    space = b"GRAY" if colorants is None else b"RGB "
    table, body, start = struct.pack(">I", len(tags)), b"", 128 + 4 + 12 * len(tags)
    for tag, data in tags.items():
        table += tag + struct.pack(">II", start + len(body), len(data))
        body += data
    header = struct.pack(
        ">I4sI4s4s4s", start + len(body), b"none", 0x02400000, b"mntr", space, b"XYZ "
    )
    header += bytes(12) + b"acsp" + bytes(28) + struct.pack(">3i", 63190, 65536, 54061) + bytes(48)
    return header + table + body


@pytest.mark.parametrize("ending", ["png", "tif", "bmp"])
def test_lossless_kinds_keep_every_pixel(picture: Array, tmp_path: Path, ending: str) -> None:
    photo = load_photo(saved(picture, tmp_path / f"a.{ending}"))
    np.testing.assert_array_equal(photo.pixels, picture)
    assert (photo.name, photo.stem, photo.size) == (f"a.{ending}", "a", (40, 30))
    assert (photo.scale, photo.focal_prior_px, photo.notes) == (1.0, None, ())
    assert not photo.pixels.flags.writeable


@pytest.mark.parametrize("ending", ["jpg", "webp", "avif"])
def test_lossy_kinds_come_close(tmp_path: Path, ending: str) -> None:
    flat = np.full((64, 64, 3), (200, 120, 60), np.uint8)
    photo = load_photo(saved(flat, tmp_path / f"a.{ending}"))
    assert np.abs(photo.pixels.astype(int) - flat).max() <= 4


def test_heic(tmp_path: Path) -> None:
    import pillow_heif

    flat = np.full((64, 96, 3), (200, 120, 60), np.uint8)
    pillow_heif.from_pillow(Image.fromarray(flat)).save(tmp_path / "a.heic", quality=95)
    photo = load_photo(tmp_path / "a.heic")
    assert photo.size == (96, 64)
    assert np.abs(photo.pixels.astype(int) - flat).max() <= 4


def lying(picture: Array, turn: int) -> Array:
    """As a file with this orientation stores the picture."""
    stored = {
        1: picture,
        2: picture[:, ::-1],
        3: picture[::-1, ::-1],
        4: picture[::-1],
        5: picture.transpose(1, 0, 2),
        6: np.rot90(picture),
        7: picture[::-1, ::-1].transpose(1, 0, 2),
        8: np.rot90(picture, -1),
    }[turn]
    return np.ascontiguousarray(stored)


def oriented(turn: int) -> Image.Exif:
    exif = Image.Exif()
    exif[0x0112] = turn
    return exif


@pytest.mark.parametrize("turn", range(1, 9))
@pytest.mark.parametrize("kind", ["png", "tif", "lzw.tif", "jpg", "webp", "avif", "heic"])
def test_orientation(tmp_path: Path, turn: int, kind: str) -> None:
    """Quadrants of four colours, so that a turn too many or a mirrored picture shows."""
    import pillow_heif

    pillow_heif.register_heif_opener()
    picture = np.zeros((64, 96, 3), np.uint8)
    picture[:32, :48], picture[:32, 48:], picture[32:, :48] = (200, 90, 60), (60, 190, 80), 128
    path = tmp_path / f"a.{kind}"
    options = {"lzw.tif": {"compression": "tiff_lzw"}, "jpg": {"quality": 95}}.get(kind, {})
    Image.fromarray(lying(picture, turn)).save(path, exif=oriented(turn), **options)
    for side, step in ((4096, 1), (48, 2)):
        photo = load_photo(path, max_side=side)
        assert photo.original_size == (96, 64)
        assert photo.pixels.shape == picture[::step, ::step].shape
        off = np.abs(photo.pixels.astype(int) - picture[::step, ::step])
        assert np.median(off) <= 4
        assert off.mean() < 12


@pytest.mark.parametrize("turn", range(1, 9))
def test_heic_as_phones_write_it(tmp_path: Path, turn: int) -> None:
    """The container turns the picture, and EXIF says the same once more."""
    import pillow_heif

    picture = np.full((64, 96, 3), 128, np.uint8)
    picture[:32, :48], picture[:32, 48:] = (200, 90, 60), (60, 190, 80)
    image = pillow_heif.from_pillow(Image.fromarray(lying(picture, turn)))
    image.save(tmp_path / "a.heic", exif=oriented(turn).tobytes())
    assert (b"irot" in (tmp_path / "a.heic").read_bytes()) == (turn in (3, 5, 6, 7, 8))
    photo = load_photo(tmp_path / "a.heic")
    assert photo.pixels.shape == picture.shape
    assert np.abs(photo.pixels.astype(int) - picture).mean() < 12


@pytest.mark.parametrize("turn", range(1, 9))
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_orientation_keeps_every_pixel(
    picture: Array, tmp_path: Path, turn: int, ending: str
) -> None:
    path = saved(lying(picture, turn), tmp_path / f"a.{ending}", exif=oriented(turn))
    np.testing.assert_array_equal(load_photo(path).pixels, picture)


def test_the_handed_tiffs_stand_upright(shared: Path) -> None:
    """James's photos, stored lying."""
    folder = shared / "data/cases/tiff_orientation/photos"
    for side in ("left", "right"):
        photo = load_photo(folder / f"{side}.tif", max_side=400)
        with Image.open(shared / f"data/james/photo_{side}.png") as image:
            original = np.asarray(image.convert("RGB").resize(photo.size))
        assert photo.size == (300, 400)
        assert np.abs(photo.pixels.astype(int) - original).mean() < 8


def test_senseless_orientation_is_upright(picture: Array, tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 99
    photo = load_photo(saved(picture, tmp_path / "a.png", exif=exif))
    np.testing.assert_array_equal(photo.pixels, picture)


def test_sixteen_bits(tmp_path: Path) -> None:
    import cv2

    eight = np.arange(240, dtype=np.uint8).reshape(12, 20)
    Image.fromarray(eight.astype(np.uint16) * 257).save(tmp_path / "grey.png")
    photo = load_photo(tmp_path / "grey.png")
    np.testing.assert_array_equal(photo.pixels, np.dstack([eight] * 3))
    assert photo.notes == ("16-bit grey: reduced to 8 bits",)
    cv2.imwrite(
        str(tmp_path / "rgb.png"),
        np.dstack([eight, eight // 2, eight // 3]).astype(np.uint16) * 257,
    )
    photo = load_photo(tmp_path / "rgb.png")
    np.testing.assert_array_equal(photo.pixels, np.dstack([eight // 3, eight // 2, eight]))


def test_deep_jpeg_2000_keeps_white(tmp_path: Path) -> None:
    import cv2

    eight = np.full((32, 40, 3), 255, np.uint8)
    eight[:, :20] = (10, 100, 200)
    cv2.imwrite(str(tmp_path / "a.jp2"), eight[:, :, ::-1].astype(np.uint16) * 257)
    pixels = load_photo(tmp_path / "a.jp2").pixels
    assert np.abs(pixels.astype(int) - eight)[:, [*range(16), *range(24, 40)]].max() <= 2


@pytest.mark.parametrize("mode", ["L", "1", "P"])
def test_grey_bitmap_and_palette(picture: Array, tmp_path: Path, mode: str) -> None:
    image = Image.fromarray(picture).convert(mode)
    image.save(tmp_path / "a.png")
    photo = load_photo(tmp_path / "a.png")
    np.testing.assert_array_equal(photo.pixels, np.asarray(image.convert("RGB")))


@pytest.mark.parametrize("mode", ["LA", "RGBA"])
def test_transparency_is_shown_on_white(tmp_path: Path, mode: str) -> None:
    image = Image.new("RGBA", (4, 2), (10, 10, 10, 255))
    image.paste((10, 10, 10, 0), (0, 0, 2, 2))
    image.convert(mode).save(tmp_path / "a.png")
    photo = load_photo(tmp_path / "a.png")
    np.testing.assert_array_equal(photo.pixels[:, :2], 255)
    np.testing.assert_array_equal(photo.pixels[:, 2:], 10)
    assert photo.notes == ("transparent parts are shown on white",)


@pytest.mark.parametrize("mode", ["L", "LA"])
@pytest.mark.parametrize("colorants", [None, P3])
def test_grey_with_a_profile(tmp_path: Path, mode: str, colorants: Array | None) -> None:
    grey = Image.new("L", (4, 2), 40).convert(mode)
    grey.save(tmp_path / "a.png", icc_profile=icc_profile(colorants, "Some"))
    photo = load_photo(tmp_path / "a.png")
    assert photo.notes == ("colours converted from Some to sRGB",)
    np.testing.assert_allclose(photo.pixels, encoded(np.array((40 / 255) ** GAMMA)), atol=1.5)


def test_transparent_palette(tmp_path: Path) -> None:
    image = Image.new("P", (2, 1))
    image.putpalette([200, 0, 0, 0, 0, 200])
    image.putdata([0, 1])
    image.save(tmp_path / "a.png", transparency=0)
    np.testing.assert_array_equal(load_photo(tmp_path / "a.png").pixels, [[[255] * 3, [0, 0, 200]]])


def test_cmyk(tmp_path: Path) -> None:
    Image.new("CMYK", (32, 32), (0, 255, 255, 0)).save(tmp_path / "a.jpg", quality=95)
    photo = load_photo(tmp_path / "a.jpg")
    assert np.abs(photo.pixels.astype(int) - (255, 0, 0)).max() <= 4
    assert photo.notes == ("CMYK without a colour profile: colours are approximate",)


def test_display_p3_becomes_srgb(tmp_path: Path) -> None:
    stored = np.array([200, 110, 90], np.uint8)
    linear = np.linalg.solve(SRGB, P3 @ (stored / 255) ** GAMMA)
    path = saved(
        np.full((8, 8, 3), stored), tmp_path / "a.png", icc_profile=icc_profile(P3, "Display P3")
    )
    photo = load_photo(path)
    assert np.abs(photo.pixels - encoded(linear)).max() < 1.5
    assert photo.notes == ("colours converted from Display P3 to sRGB",)


def test_srgb_profile_changes_nothing(picture: Array, tmp_path: Path) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    photo = load_photo(saved(picture, tmp_path / "a.png", icc_profile=profile))
    np.testing.assert_array_equal(photo.pixels, picture)
    assert not photo.notes


def test_damaged_profile_is_noted(picture: Array, tmp_path: Path) -> None:
    photo = load_photo(saved(picture, tmp_path / "a.png", icc_profile=b"no profile" * 20))
    np.testing.assert_array_equal(photo.pixels, picture)
    assert "colour profile is damaged" in photo.notes[0]


def test_first_of_several_pictures(picture: Array, tmp_path: Path) -> None:
    second = Image.fromarray(picture[::-1].copy())
    path = saved(picture, tmp_path / "a.tif", save_all=True, append_images=[second])
    photo = load_photo(path)
    np.testing.assert_array_equal(photo.pixels, picture)
    assert photo.notes == ("holds 2 pictures: the first is used",)


def test_large_photo_is_scaled(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 50
    pixels = np.full((300, 600, 3), 77, np.uint8)
    photo = load_photo(saved(pixels, tmp_path / "a.jpg", exif=exif), max_side=150)
    assert photo.size == (150, 75)
    assert photo.original_size == (600, 300)
    assert photo.scale == 0.25
    assert photo.notes == ("scaled from 600x300 to 150x75",)
    assert photo.focal_prior_px == pytest.approx(50 / 43.2666 * np.hypot(150, 75), rel=1e-5)
    np.testing.assert_array_equal(photo.pixels, 77)


def test_hundred_megapixels(tmp_path: Path) -> None:
    Image.new("L", (10_000, 10_000), 50).save(tmp_path / "a.jpg")
    photo = load_photo(tmp_path / "a.jpg")
    assert photo.size == (4096, 4096)
    np.testing.assert_array_equal(photo.pixels[::512, ::512], 50)


def png_that_claims(width: int, height: int) -> bytes:
    """A PNG of a few bytes whose header states any size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    parts = (chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(b"")), chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize("side", [13_300, 30_000])
def test_too_large_is_refused_by_its_header(tmp_path: Path, side: int) -> None:
    (tmp_path / "a.png").write_bytes(png_that_claims(side, side))
    with pytest.raises(FileFormatError, match=r"a\.png: expected at most 175 megapixels, found"):
        load_photo(tmp_path / "a.png")


def test_truncated(tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = rng.integers(0, 256, (200, 200, 3), dtype=np.uint8)
    for ending in ("jpg", "png"):
        path = saved(pixels, tmp_path / f"a.{ending}")
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(FileFormatError, match=rf"a\.{ending}: expected a whole image, found"):
            load_photo(path)


def test_header_alone(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png_that_claims(0, 5))
    with pytest.raises(FileFormatError, match=r"a\.png: expected"):
        load_photo(tmp_path / "a.png")


def test_not_an_image(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_text("<html>not found</html>")
    with pytest.raises(FileFormatError, match=r"a\.jpg: expected an image .* found a text file"):
        load_photo(path)
    path.write_bytes(bytes(range(256)))
    with pytest.raises(FileFormatError, match=r"found something else"):
        load_photo(path)
    path.write_bytes(b"")
    with pytest.raises(FileFormatError, match=r"a\.jpg: expected a photo, found an empty file"):
        load_photo(path)


def test_missing_folder_and_forbidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"b\.jpg: expected a photo, got no such file"):
        load_photo(tmp_path / "b.jpg")
    with pytest.raises(InputError, match="expected a photo, got a folder"):
        load_photo(tmp_path)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "c.jpg").touch()
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(
        InputError, match="expected a photo that can be read, got Permission denied"
    ):
        load_photo(tmp_path / "c.jpg")


def test_floating_point_samples(tmp_path: Path) -> None:
    Image.fromarray(np.ones((4, 4), np.float32)).save(tmp_path / "a.tif")
    expected = r"a\.tif: expected 8 or 16 bits a sample, found floating-point samples"
    with pytest.raises(FileFormatError, match=expected):
        load_photo(tmp_path / "a.tif")


def test_colour_in_floating_point(tmp_path: Path) -> None:
    import cv2

    cv2.imwrite(str(tmp_path / "a.tif"), np.ones((4, 4, 3), np.float32))
    with pytest.raises(FileFormatError, match=r"found something else \(a TIFF of a kind that"):
        load_photo(tmp_path / "a.tif")


@pytest.mark.parametrize(("low", "high"), [(0, 70_000), (-1, 5)])
def test_thirty_two_bits(tmp_path: Path, low: int, high: int) -> None:
    Image.fromarray(np.array([[low, high]], np.int32)).save(tmp_path / "a.tif")
    expected = f"expected 8 or 16 bits a sample, found values from {low} to {high}"
    with pytest.raises(FileFormatError, match=expected):
        load_photo(tmp_path / "a.tif")


def test_max_side(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="max_side: expected a number above zero"):
        load_photo(tmp_path / "a.jpg", max_side=0)


def test_nul_in_a_path() -> None:
    expected = r"a\\x00\.png.*: expected a photo, got a name that holds a NUL"
    with pytest.raises(InputError, match=expected):
        load_photo("a\0.png")
