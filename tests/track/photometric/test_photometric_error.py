"""Difference and correlation of two pictures, by NumPy's own."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.image.frame_pyramid import FrameCrop
from mien.track.photometric.linearization import ImagePair
from mien.track.photometric.photometric_error import photometric_error

SIZE = (40, 30)


def image_pair(drawn: Array, target: Array, mask: Array) -> ImagePair:
    ids = np.where(mask > 0, 0, -1).astype(np.int32)
    return ImagePair(ids, np.float32(mask), np.float32(drawn), np.float32(target))


def a_view(brightest: float = 100.0) -> FrameCrop:
    pixels = np.full((*SIZE, 3), brightest, np.float32)
    inside = np.full(SIZE, float(brightest < 255), np.float32)
    return FrameCrop(pixels, inside, 100.0, 15.0, 20.0)


def test_as_numpy_has_it(rng: np.random.Generator) -> None:
    drawn, target = rng.uniform(0, 255, (2, *SIZE))
    mask, weights = np.zeros(SIZE), np.float32(rng.uniform(0, 1, SIZE))
    mask[5:30, 4:20] = 1
    found = photometric_error(image_pair(drawn, target, mask), a_view(), weights * np.float32(mask))
    chosen = (weights > 0.25) & (mask > 0)
    a, b = drawn[chosen], target[chosen]
    assert found.rms == pytest.approx(np.sqrt(((a - b) ** 2).mean()), rel=1e-5)
    assert found.ncc == pytest.approx(np.corrcoef(a, b)[0, 1], rel=1e-4)
    assert found.seen == pytest.approx(weights[mask > 0].mean(), rel=1e-5)


def test_too_bright_is_not_covered() -> None:
    mask, weights = np.ones(SIZE), np.ones(SIZE, np.float32)
    weights[:20] = 0
    picture = image_pair(np.zeros(SIZE), np.zeros(SIZE), mask)
    assert photometric_error(picture, a_view(), weights).seen == pytest.approx(0.5)
    bright = a_view(255.0)
    bright.valid[20:] = 1
    assert photometric_error(picture, bright, weights).seen == pytest.approx(1)


def test_nothing_to_compare() -> None:
    nothing = image_pair(*np.zeros((3, *SIZE)))
    assert photometric_error(nothing, a_view(), np.zeros(SIZE, np.float32)) == (np.inf, 0.0, 0.0)
