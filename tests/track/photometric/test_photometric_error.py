"""Difference and correlation of two pictures, by NumPy's own."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.image.frame_pyramid import View
from mien.track.photometric.linearization import Pictures
from mien.track.photometric.photometric_error import agreement

SIZE = (40, 30)


def pictures(drawn: Array, target: Array, mask: Array) -> Pictures:
    ids = np.where(mask > 0, 0, -1).astype(np.int32)
    return Pictures(ids, np.float32(mask), np.float32(drawn), np.float32(target))


def a_view(brightest: float = 100.0) -> View:
    pixels = np.full((*SIZE, 3), brightest, np.float32)
    inside = np.full(SIZE, float(brightest < 255), np.float32)
    return View(pixels, inside, 100.0, 15.0, 20.0)


def test_as_numpy_has_it(rng: np.random.Generator) -> None:
    drawn, target = rng.uniform(0, 255, (2, *SIZE))
    mask, weights = np.zeros(SIZE), np.float32(rng.uniform(0, 1, SIZE))
    mask[5:30, 4:20] = 1
    found = agreement(pictures(drawn, target, mask), a_view(), weights * np.float32(mask))
    chosen = (weights > 0.25) & (mask > 0)
    a, b = drawn[chosen], target[chosen]
    assert found.rms == pytest.approx(np.sqrt(((a - b) ** 2).mean()), rel=1e-5)
    assert found.likeness == pytest.approx(np.corrcoef(a, b)[0, 1], rel=1e-4)
    assert found.seen == pytest.approx(weights[mask > 0].mean(), rel=1e-5)


def test_too_bright_is_not_covered() -> None:
    mask, weights = np.ones(SIZE), np.ones(SIZE, np.float32)
    weights[:20] = 0
    picture = pictures(np.zeros(SIZE), np.zeros(SIZE), mask)
    assert agreement(picture, a_view(), weights).seen == pytest.approx(0.5)
    bright = a_view(255.0)
    bright.inside[20:] = 1
    assert agreement(picture, bright, weights).seen == pytest.approx(1)


def test_nothing_to_compare() -> None:
    nothing = pictures(*np.zeros((3, *SIZE)))
    assert agreement(nothing, a_view(), np.zeros(SIZE, np.float32)) == (np.inf, 0.0, 0.0)
