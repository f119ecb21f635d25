from __future__ import annotations

import math
from fractions import Fraction

import pytest
from PIL import Image

from mien.capture.images.exif import focal_prior_px

FOCAL, FOCAL_35, PIXEL_X, PIXEL_Y, RESOLUTION, UNIT = 0x920A, 0xA405, 0xA002, 0xA003, 0xA20E, 0xA210


def focal(
    tags: dict[int, object], size: tuple[int, int] = (400, 300)
) -> tuple[float | None, list[str]]:
    image = Image.new("L", size)
    image.getexif().get_ifd(0x8769).update(tags)
    return focal_prior_px(image)


def test_equivalent_counts_by_the_diagonal() -> None:
    # The diagonal of 400 x 300 is 500; a 43.27 mm lens on film has a focal length of one diagonal.
    px, notes = focal({FOCAL_35: math.hypot(36, 24)})
    assert px == pytest.approx(500)
    assert not notes


def test_focal_plane_resolution() -> None:
    # 10 mm at 50 px a mm, the photo since reduced to half.
    tags = {FOCAL: Fraction(10), RESOLUTION: Fraction(500), UNIT: 3, PIXEL_X: 800, PIXEL_Y: 600}
    assert focal(tags)[0] == pytest.approx(250)
    assert focal({FOCAL: 10.0, RESOLUTION: 1270.0})[0] == pytest.approx(500)


def test_equivalent_wins() -> None:
    tags = {FOCAL_35: math.hypot(36, 24), FOCAL: 10.0, RESOLUTION: 1.0}
    assert focal(tags)[0] == pytest.approx(500)


@pytest.mark.parametrize(
    "tags", [{}, {FOCAL_35: 0}, {FOCAL: 35.0}, {FOCAL_35: "wide"}, {RESOLUTION: 9.0}]
)
def test_unknown(tags: dict[int, object]) -> None:
    assert focal(tags) == (None, [])


def test_cropped_since() -> None:
    px, notes = focal({FOCAL_35: 50, PIXEL_X: 400, PIXEL_Y: 400})
    assert px is None
    assert notes == ["cropped after it was taken: its focal length is not used"]


def test_turned_since_is_no_crop() -> None:
    assert focal({FOCAL_35: 50, PIXEL_X: 600, PIXEL_Y: 800})[0] is not None


def test_senseless() -> None:
    px, notes = focal({FOCAL_35: 65535})
    assert px is None
    assert "senseless focal length" in notes[0]
