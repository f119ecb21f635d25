"""Focal lengths as users write them, and what is known of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import posable
from mien.camera import Camera
from mien.errors import InputError
from mien.head import FittedView, Head
from mien.track.lens import LogFocal, expected_focal, parse_lens

FRONT = np.diag([1.0, -1.0, -1.0])


@pytest.mark.parametrize(
    ("text", "focal_px"),
    [
        ("1200px", 1200.0),
        (" 950.5 px ", 950.5),
        # 50 mm are 50 / 43.267 diagonals.
        ("50mm", 50 / np.hypot(36, 24) * np.hypot(1920, 1080)),
        ("90deg", 960.0),
    ],
)
def test_lens_as_written(text: str, focal_px: float) -> None:
    assert parse_lens(text, 1920, 1080) == pytest.approx(focal_px)
    assert parse_lens(text, 1080, 1920) == pytest.approx(focal_px)


@pytest.mark.parametrize("text", ["", "1200", "px", "-5px", "1e3px", "nan mm", "5 cm", "5px5"])
def test_lens_that_cannot_be_read(text: str) -> None:
    with pytest.raises(InputError, match="lens: expected a number with its unit: 1200px, 28mm"):
        parse_lens(text, 1920, 1080)


@pytest.mark.parametrize("text", ["0px", "0.0mm", "180deg", "200deg"])
def test_what_no_lens_is(text: str) -> None:
    with pytest.raises(InputError, match="lens: expected more than 0, and less than 180deg"):
        parse_lens(text, 1920, 1080)


def test_bad_precision() -> None:
    with pytest.raises(InputError, match="precision: expected a number above zero"):
        LogFocal(6.0, 0.0)


def with_photos(*sizes: tuple[int, int], diagonals: float = 1.2) -> Head:
    views = tuple(
        FittedView(
            f"{index}.png",
            Camera(*size, diagonals * float(np.hypot(*size)), FRONT, np.array([0.0, 0, 600])),
            1.0,
            400,
        )
        for index, size in enumerate(sizes)
    )
    head = posable.head()
    neutral = replace(head.expressions["neutral"], views=views)
    return replace(head, expressions={**head.expressions, "neutral": neutral})


@pytest.mark.parametrize("size", [(1920, 1080), (640, 360), (1080, 1920)])
def test_a_video_in_the_photos_shape_is_expected_to_be_of_their_camera(
    size: tuple[int, int],
) -> None:
    expected = expected_focal(with_photos((1280, 720), (1000, 1000)), *size)
    assert expected.focal_px == pytest.approx(1.2 * np.hypot(*size))
    assert expected.deviation == pytest.approx(0.15)


def test_any_other_video_may_be_of_any_lens() -> None:
    expected = expected_focal(with_photos((1280, 720)), 640, 480)
    assert expected.focal_px == pytest.approx(1.7 * 800)
    assert expected.deviation == pytest.approx(0.6)
    assert expected_focal(posable.head(), 640, 480) == expected
