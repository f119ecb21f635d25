from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mien.arrays import Array
from mien.errors import InputError
from mien.numeric.images.hole_filling import fill_growing, fill_pyramid

FILLS = pytest.mark.parametrize("fill", [fill_pyramid, fill_growing])


@FILLS
@pytest.mark.parametrize("wrap", [False, True])
@pytest.mark.parametrize("shape", [(32, 64), (37, 53), (1, 9)])
def test_constants_are_exact(
    fill: Callable[..., Array], wrap: bool, shape: tuple[int, int], rng: np.random.Generator
) -> None:
    known = rng.random(shape) > 0.9
    known[0, 0] = True
    image = np.where(known[..., None], [0.25, 0.5, 0.7], np.nan_to_num(rng.random((*shape, 3))))
    filled = fill(image, known, wrap=wrap)
    np.testing.assert_allclose(filled, np.broadcast_to([0.25, 0.5, 0.7], filled.shape), atol=1e-6)


@FILLS
def test_known_pixels_stay_as_they_are(
    fill: Callable[..., Array], rng: np.random.Generator
) -> None:
    image = rng.random((40, 50, 3)).astype(np.float32)
    known = rng.random((40, 50)) > 0.7
    filled = fill(image, known)
    np.testing.assert_array_equal(filled[known], image[known])
    assert filled.min() >= image[known].min()
    assert filled.max() <= image[known].max()


@FILLS
def test_wrapping_fills_across_the_seam(fill: Callable[..., Array]) -> None:
    image = np.zeros((16, 64, 1), np.float32)
    image[:, 50:52] = 1
    known = np.zeros((16, 64), bool)
    known[:, 50:52] = known[:, 20:22] = True
    open_, wrapped = fill(image, known)[8, 2, 0], fill(image, known, wrap=True)[8, 2, 0]
    assert open_ < 0.1
    assert wrapped > 0.5


@FILLS
def test_wrapped_ends_agree(fill: Callable[..., Array], rng: np.random.Generator) -> None:
    known = np.zeros((64, 128), bool)
    known[:, 30:80] = True
    filled = fill(rng.random((64, 128, 3)), known, wrap=True)
    assert np.abs(filled[:, 0] - filled[:, -1]).max() < 0.02


def test_a_mirrored_image_fills_to_the_mirrored_result(rng: np.random.Generator) -> None:
    image, known = rng.random((24, 32, 2)), rng.random((24, 32)) > 0.8
    there = fill_growing(image, known)
    back = fill_growing(image[:, ::-1], known[:, ::-1])[:, ::-1]
    np.testing.assert_allclose(there, back, atol=1e-6)


def test_weights_between_blend_with_the_surroundings() -> None:
    image = np.full((8, 8, 1), 1.0)
    image[4, 4] = 0
    weights = np.ones((8, 8))
    weights[4, 4] = 0.25
    filled = fill_pyramid(image, weights)[4, 4, 0]
    assert 0.5 < filled < 0.8


@FILLS
def test_bad_input_is_refused(fill: Callable[..., Array]) -> None:
    with pytest.raises(InputError, match="weights: expected at least one known pixel, got none"):
        fill(np.ones((4, 4, 3)), np.zeros((4, 4), bool))
    with pytest.raises(InputError, match=r"weights: expected shape \(4, 4\)"):
        fill(np.ones((4, 4, 3)), np.ones((3, 4), bool))
