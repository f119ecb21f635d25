"""Composed images against photos and warps that are known."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.errors import InputError
from mien.synthesis.compose import Composer
from mien.synthesis.examples import Example, ExampleSet

WIDTH, HEIGHT, COUNT = 240, 300, 4
MATRIX, SHIFT = np.array([[0.98, 0.05], [-0.03, 1.02]]), np.array([2.0, -3.0])


def painted(places):
    """A smooth picture, 3 channels, whose values are known everywhere: (..., 2) px."""
    x, y = places[..., 0], places[..., 1]
    waves = [np.sin(x / 11), np.cos(y / 13), np.sin((x + y) / 17)]
    return 127.5 + 100 * np.stack(waves, -1)


def centres():
    return np.stack(np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5), -1)


def rounded(picture):
    return np.uint8(picture + 0.5)


def psnr(a, b):
    return 10 * np.log10(255**2 / max(np.mean((a.astype(float) - b) ** 2), 1e-9))


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


def made(layout, photos, standard=0):
    """Examples that jitter around the mean face, with these photos."""
    rng = np.random.default_rng(0)
    base = layout.template - layout.template.mean(0)
    points = base * 0.6 * WIDTH + [WIDTH / 2, HEIGHT / 2]
    places = [points] + [points + rng.normal(0, 0.5, points.shape) for _ in photos[1:]]
    pairs = zip(photos, places, strict=True)
    examples = tuple(Example(f"e{i}", photo, p, "") for i, (photo, p) in enumerate(pairs))
    subregions = default_subregions(layout, places[standard], (WIDTH, HEIGHT))
    return ExampleSet(layout, examples, standard, np.stack(places), subregions)


@pytest.fixture(scope="module")
def noisy(layout):
    rng = np.random.default_rng(1)
    shape = (HEIGHT, WIDTH, 3)
    return made(layout, [rng.integers(0, 256, shape, np.uint8) for _ in range(COUNT)], 2)


def shares(example_set, row):
    return np.tile(np.asarray(row, float), (len(example_set.subregions.names), 1))


def core(example_set):
    """Where the standard image is all face, well inside."""
    import cv2

    whole = np.uint8(example_set.subregions.fades.sum(2) > 1 - 1e-6)
    return cv2.erode(whole, np.ones((15, 15), np.uint8), borderValue=0) > 0


def test_neutral_at_its_own_points_is_its_photo(noisy):
    image = Composer(noisy).render(noisy.neutral.points, shares(noisy, [1, 0, 0, 0]))
    np.testing.assert_array_equal(image, noisy.neutral.photo)


@pytest.mark.parametrize("index", range(COUNT))
def test_an_examples_own_points_give_that_example(noisy, index):
    example = noisy.examples[index]
    image = Composer(noisy).render(example.points, shares(noisy, np.eye(COUNT)[index]))
    inside = core(noisy)
    assert inside.mean() > 0.1
    assert psnr(image[inside], example.photo[inside]) > 40


def test_outside_of_the_face_the_neutral_photo_stays(noisy):
    image = Composer(noisy).render(noisy.neutral.points, shares(noisy, [0, 1, 0, 0]))
    for corner in (np.s_[:8, :8], np.s_[:8, -8:], np.s_[-8:, :8], np.s_[-8:, -8:]):
        np.testing.assert_array_equal(image[corner], noisy.neutral.photo[corner])
    assert (image != noisy.neutral.photo).any()


def test_an_affine_motion_of_all_points_is_that_of_the_picture(layout):
    example_set = made(layout, [rounded(painted(centres()))])
    # Not a similarity: the frame around the face follows only nearly, the face's inside exactly.
    points = example_set.neutral.points
    image = Composer(example_set).render(points @ MATRIX.T + SHIFT, shares(example_set, [1]))
    back = (centres() - SHIFT) @ np.linalg.inv(MATRIX).T
    inside = core(example_set)
    assert psnr(image[inside], painted(back)[inside]) > 40


def test_plain_colours_mix_exactly(layout):
    colours = np.array([[10, 200, 30], [250, 0, 90], [100, 100, 250]])
    photos = [np.full((HEIGHT, WIDTH, 3), colour, np.uint8) for colour in colours]
    example_set = made(layout, photos)
    row = np.array([0.2, 0.5, 0.3])
    image = Composer(example_set).render(example_set.neutral.points, shares(example_set, row))
    inside = image[core(example_set)]
    np.testing.assert_array_equal(inside, np.broadcast_to(rounded(row @ colours), inside.shape))


def test_any_number_of_threads_gives_the_same_bytes(noisy):
    rng = np.random.default_rng(2)
    coefficients = rng.dirichlet(np.ones(COUNT), len(noisy.subregions.names))
    composer, before = Composer(noisy), numba.get_num_threads()
    try:
        images = []
        for threads in range(1, min(3, numba.config.NUMBA_NUM_THREADS) + 1):
            numba.set_num_threads(threads)
            images.append(composer.render(noisy.neutral.points + 1.3, coefficients))
    finally:
        numba.set_num_threads(before)
    assert all(np.array_equal(image, images[0]) for image in images)


def test_shares_left_out_change_little(noisy):
    rng = np.random.default_rng(3)
    skip = 0.02
    coefficients = rng.dirichlet([5, 0.1, 0.1, 3], len(noisy.subregions.names))
    points = noisy.neutral.points
    image = Composer(noisy, skip=skip).render(points, coefficients).astype(int)
    exact = Composer(noisy, skip=0).render(points, coefficients)
    assert 0 < np.abs(image - exact).max() <= 2 * 255 * skip * COUNT + 1


def test_draws_into_memory_that_is_there(noisy):
    out = np.empty_like(noisy.neutral.photo)
    coefficients = shares(noisy, [0.5, 0.5, 0, 0])
    assert Composer(noisy).render(noisy.neutral.points, coefficients, out=out) is out
    np.testing.assert_array_equal(out, Composer(noisy).render(noisy.neutral.points, coefficients))


def test_points_outside_of_the_photo_are_no_harm(noisy):
    points = noisy.neutral.points + np.array([WIDTH, 0.6 * HEIGHT])
    image = Composer(noisy).render(points, shares(noisy, [0, 0, 1, 0]))
    np.testing.assert_array_equal(image[:50, :50], noisy.neutral.photo[:50, :50])


def test_bad_input_is_named(noisy):
    composer, points = Composer(noisy), noisy.neutral.points
    good = shares(noisy, [1, 0, 0, 0])
    with pytest.raises(InputError, match="points"):
        composer.render(points[:5], good)
    with pytest.raises(InputError, match="finite"):
        composer.render(points * np.nan, good)
    with pytest.raises(InputError, match="coefficients"):
        composer.render(points, good[:3])
    with pytest.raises(InputError, match="sum to 1"):
        composer.render(points, 2 * good)
    with pytest.raises(InputError, match="out"):
        composer.render(points, good, out=np.empty((3, 3, 3), np.uint8))
    with pytest.raises(InputError, match="skip"):
        Composer(noisy, skip=-1)


def test_photos_of_one_row_are_refused(layout, noisy):
    strip = Example("strip", np.zeros((1, 9, 3), np.uint8), noisy.neutral.points, "")
    parts = (noisy.neutral, strip), 0, noisy.statistics, noisy.subregions
    with pytest.raises(InputError, match="two rows"):
        Composer(ExampleSet(layout, *parts))
