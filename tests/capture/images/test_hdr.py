"""HDR codes of known light, by the formulas of BT.2100, come back as sRGB has that light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from filmed import coded_hdr, hdr_written
from mien.arrays import Array
from mien.capture.images.hdr import HLG, KNEE, PQ, WHITE, hdr_to_srgb
from mien.capture.images.photos import load_photo
from mien.capture.video.video import Video

BT709, BT2020 = 1, 9
SKIN = np.array([[236, 188, 160], [198, 134, 100], [141, 85, 54], [80, 45, 30]], float)


def through(codes: Array, transfer: int) -> Array:
    signal = np.rint(65535 * coded_hdr(codes, transfer)).astype(np.uint16)
    return hdr_to_srgb(signal, transfer, BT2020).astype(float)


@pytest.mark.parametrize("transfer", [HLG, PQ])
def test_greys_and_skin_keep_their_tones(transfer: int) -> None:
    greys = np.repeat(np.arange(0, 255 * KNEE)[:, None], 3, axis=1)
    skin = SKIN * (255 * KNEE / SKIN.max())
    for codes in (greys[None], skin[None]):
        assert np.abs(through(codes, transfer) - codes).max() <= 3


@pytest.mark.parametrize("transfer", [HLG, PQ])
def test_highlights_are_compressed_and_never_turn_back(transfer: int) -> None:
    # In units of ordinary white: from there to the peak.
    light = np.linspace(0.5, 1000 / WHITE, 200)
    coded = 255 * (1.055 * light ** (1 / 2.4) - 0.055)
    shown = through(np.repeat(coded[None, :, None], 3, axis=2), transfer)[0]
    assert (np.diff(shown[:, 0]) >= -1).all()  # Rounded codes.
    assert 240 <= shown[np.abs(light - 1).argmin(), 0] <= 246
    assert shown[-1].min() >= 254
    assert np.ptp(shown, axis=1).max() <= 1


def test_bright_colours_keep_their_hue() -> None:
    coded = np.array([[[400.0, 300, 200]]])
    shown = through(coded, PQ)[0, 0] / 255
    linear = ((shown + 0.055) / 1.055) ** 2.4
    expected = ((coded[0, 0] / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(linear / linear[0], expected / expected[0], atol=0.02)


def test_primaries_of_ordinary_video_stay() -> None:
    half = np.full((1, 1, 3), 0.5) * [1, 0, 0]
    red = hdr_to_srgb(np.rint(65535 * half).astype(np.uint16), PQ, BT709)[0, 0]
    assert red[0] > 0
    assert not red[1:].any()


@pytest.mark.parametrize("transfer", [HLG, PQ])
def test_a_photo(tmp_path: Path, transfer: int) -> None:
    """A HEIC as cameras write it. Eight bits of PQ are some levels of sRGB apart."""
    import pillow_heif

    picture = np.repeat(np.repeat(SKIN[None] * 0.95, 64, axis=0), 64, axis=1)
    codes = np.rint(255 * coded_hdr(picture, transfer)).astype(np.uint8)
    pillow_heif.from_pillow(Image.fromarray(codes)).save(
        tmp_path / "a.heic",
        quality=100,
        color_primaries=BT2020,
        transfer_characteristics=transfer,
        matrix_coefficients=9,
        full_range_flag=1,
    )
    photo = load_photo(tmp_path / "a.heic")
    found = photo.pixels[32, 32::64].astype(int)
    assert np.abs(found - SKIN * 0.95).max() <= 8
    name = {HLG: "HLG", PQ: "PQ"}[transfer]
    assert photo.notes == (f"HDR photo ({name}): its colours are mapped to sRGB",)


@pytest.mark.parametrize("transfer", [HLG, PQ])
@pytest.mark.parametrize("stated", [True, False])
def test_a_clip(tmp_path: Path, transfer: int, stated: bool) -> None:
    """Patches of skin and grey, 10 bits, as a phone films: within a few levels of what they are."""
    patches = np.vstack([SKIN * 0.95, [[g] * 3 for g in (0, 30, 64, 118, 180, 225)]])
    picture = np.repeat(np.repeat(patches[None], 48, axis=0), 32, axis=1)
    video = Video(hdr_written(tmp_path / "a.mp4", [picture] * 3, transfer, matrix_stated=stated))
    frames = list(video.frames())
    for side in (None, 160):
        shown = frames[0].pixels(max_side=side)
        found = shown[shown.shape[0] // 2, shown.shape[1] // 20 :: shown.shape[1] // 10].astype(int)
        assert np.abs(found - patches).max() <= 5
    name = {HLG: "HLG", PQ: "PQ"}[transfer]
    assert video.notes == [f"HDR video ({name}): its colours are mapped to sRGB"]
