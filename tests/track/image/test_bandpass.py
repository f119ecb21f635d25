"""What a band keeps of a picture, and what drops out."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.track.image.bandpass import band_pass, odd

SIZE, WIDTH = 60, 11


def a_disc(radius: float = 22) -> Array:
    rows, columns = np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2
    return np.float32(np.hypot(rows, columns) < radius)


def smooth(rng: np.random.Generator) -> Array:
    rows, columns = np.mgrid[:SIZE, :SIZE]
    phases = rng.uniform(0, 6, 2)
    return np.float32(100 + 40 * np.sin(rows / 3 + phases[0]) * np.cos(columns / 4 + phases[1]))


def bands(
    layers: Array, target: Array, mask: Array, weights: Array | float = 1.0
) -> tuple[Array, ...]:
    """Of layers whose mixture is their mean."""
    weights = np.float32(weights * np.ones_like(mask))
    luma = np.float32(mask * layers.mean(axis=2))
    return band_pass(mask[..., None] * layers, luma, target, mask, weights, WIDTH)


def test_brighter_is_the_same(rng: np.random.Generator) -> None:
    mask, target = a_disc(), smooth(rng)
    layers = np.dstack([smooth(rng), smooth(rng)])
    before = bands(layers, target, mask)
    after = bands(layers + np.float32(30), target - np.float32(20), mask)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-3)
        assert np.abs(one).max() > 10


def test_a_ramp_goes_and_what_is_finer_stays() -> None:
    rows, columns = np.mgrid[:SIZE, :SIZE].astype(np.float32)
    mask = np.ones((SIZE, SIZE), np.float32)
    inner = np.s_[WIDTH:-WIDTH, WIDTH:-WIDTH]
    _, ramp, _ = bands((2 * columns + rows)[..., None], rows, mask)
    np.testing.assert_allclose(ramp[inner], 0, atol=1e-3)
    # A box of n pixels keeps sin(n w / 2) / (n sin(w / 2)) of a wave; the rest is the band.
    for frequency in (0.15, 0.4, 1.2):
        wave = np.float32(100 + 30 * np.sin(frequency * columns))
        kept = 1 - np.sin(WIDTH * frequency / 2) / (WIDTH * np.sin(frequency / 2))
        _, found, _ = bands(wave[..., None], rows, mask)
        np.testing.assert_allclose(found[inner], kept * (wave[inner] - 100), atol=0.01)


def test_a_mixture_of_bands_is_the_band_of_the_mixture(rng: np.random.Generator) -> None:
    layers = np.dstack([smooth(rng), smooth(rng)])
    found, mixed, _ = bands(layers, smooth(rng), a_disc())
    np.testing.assert_allclose(found.mean(axis=2), mixed, atol=1e-3)


@pytest.mark.parametrize("covered", [False, True])
def test_nothing_of_what_is_not_the_face_gets_in(rng: np.random.Generator, covered: bool) -> None:
    mask, target, layers = a_disc(), smooth(rng), np.dstack([smooth(rng)] * 2)
    weights = np.ones_like(mask)
    if covered:
        weights[:, :25] = 0
    elsewhere = (mask * weights) == 0
    other = np.where(elsewhere, np.float32(250), target)
    one, two = (bands(layers, frame, mask, weights)[2] for frame in (target, other))
    seen = ~elsewhere
    np.testing.assert_allclose(one[seen], two[seen], atol=2e-3)
    assert np.isfinite(one).all()


def test_drawn_and_target_alike_have_the_same_band(rng: np.random.Generator) -> None:
    mask, picture = a_disc(), smooth(rng)
    weights = np.float32(rng.uniform(0, 1, mask.shape))
    _, drawn, target = bands(picture[..., None], picture, mask, weights)
    np.testing.assert_allclose(drawn[mask > 0], target[mask > 0], atol=2e-3)


@pytest.mark.parametrize(("width", "whole"), [(0.2, 3), (7.4, 7), (8.1, 9), (29.9, 29)])
def test_odd(width: float, whole: int) -> None:
    assert odd(width) == whole
