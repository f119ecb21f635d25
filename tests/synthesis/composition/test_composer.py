"""Composed images against photos and warps that are known."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.errors import InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.composition.border_padding import pad_with_blurred_border
from mien.synthesis.composition.composer import Composer
from mien.synthesis.examples.example_set import Example, ExampleSet

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


def examples_of(layout, photos, standard=0):
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
    return examples_of(layout, [rng.integers(0, 256, shape, np.uint8) for _ in range(COUNT)], 2)


def same_everywhere(example_set, row):
    return np.tile(np.asarray(row, float), (len(example_set.subregions.names), 1))


def similarity(a, b, x, y):
    return PlanarSimilarity(np.array(a), np.array(b), np.array([x, y], float))


def grown(mask, by):
    """By some pixels on all sides; below 0, shrunk."""
    import cv2

    kernel = np.ones((2 * abs(by) + 1,) * 2, np.uint8)
    change = cv2.dilate if by > 0 else cv2.erode
    return change(np.uint8(mask), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def meshed(example_set):
    """The pixels within the triangulation's frame around the neutral face."""
    import cv2

    frame = example_set.layout.frame(example_set.neutral.points)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.fillPoly(mask, [np.int32(np.round(frame))], 1)
    return mask > 0


def core(example_set):
    """Where the standard image is all face, well inside."""
    return grown(example_set.subregions.fades.sum(2) > 1 - 1e-6, -7)


def test_neutral_at_its_own_points_is_its_photo(noisy):
    image = Composer(noisy).render(noisy.neutral.points, same_everywhere(noisy, [1, 0, 0, 0]))
    np.testing.assert_array_equal(image, noisy.neutral.photo)


@pytest.mark.parametrize("index", range(COUNT))
def test_an_examples_own_points_give_that_example(noisy, index):
    example = noisy.examples[index]
    composer = Composer(noisy)
    own, motion = same_everywhere(noisy, np.eye(COUNT)[index]), composer.head_motion(example.points)
    image = composer.render(example.points, own, motion=motion)
    inside = core(noisy)
    assert inside.mean() > 0.1
    assert psnr(image[inside], example.photo[inside]) > 40


@pytest.mark.parametrize("motion", [None, similarity(1, 0, 0, 0)])
def test_outside_of_the_mesh_the_neutral_photo_stays(noisy, motion):
    points = noisy.neutral.points + np.random.default_rng(4).normal(0, 2, (1, 2))
    image = Composer(noisy).render(points, same_everywhere(noisy, [0, 1, 0, 0]), motion=motion)
    outside = ~grown(meshed(noisy), 2)
    assert outside.any()
    np.testing.assert_array_equal(image[outside], noisy.neutral.photo[outside])
    assert (image != noisy.neutral.photo).any()


def test_around_the_subregions_the_neutral_photo_follows_the_mesh(layout):
    """Examples are black: what is not, is neutral; it moves as the points next to it do."""
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    example_set = examples_of(layout, [rounded(painted(centres())), black])
    neutral = example_set.neutral.points
    image = Composer(example_set).render(
        neutral + np.array([6, 0]), same_everywhere(example_set, [0, 1])
    )
    off_face = grown(example_set.subregions.fades.sum(2) > 0, 8)
    ring = grown(meshed(example_set), -2) & ~off_face
    assert ring.any()
    assert (image[ring] != example_set.neutral.photo[ring]).any()
    # Smooth, so that what moved by 0 to 6 px is near, and nothing is black.
    steps = np.abs(painted(centres() - [6, 0]) - painted(centres())).max()
    assert np.abs(image[ring].astype(float) - painted(centres())[ring]).max() < steps + 2


def test_a_moved_picture_is_the_unmoved_one_moved(noisy):
    """By whole pixels exactly."""
    rng = np.random.default_rng(5)
    points = noisy.neutral.points + rng.normal(0, 1, noisy.neutral.points.shape)
    coefficients = rng.dirichlet(np.ones(COUNT), len(noisy.subregions.names))
    composer, size = Composer(noisy), (WIDTH + 40, HEIGHT + 30)
    still = composer.render(points, coefficients)
    moved = composer.render(
        points + np.array([17, 9]), coefficients, motion=similarity(1, 0, 17, 9), size=size
    )
    np.testing.assert_array_equal(moved[9 : 9 + HEIGHT, 17 : 17 + WIDTH], still)
    # Beyond its edges the photo is continued.
    larger, margin = pad_with_blurred_border(noisy.neutral.photo)
    above = larger[margin - 9 : margin, margin - 17 : margin - 17 + size[0]]
    np.testing.assert_array_equal(moved[:9], above)


@pytest.mark.parametrize("motion", [similarity(1, 0, 0.5, -0.25), similarity(1.1, 0.2, 31, -33)])
def test_the_picture_moves_with_the_head(layout, motion):
    """Mesh and background show the same motion, and meet."""
    example_set = examples_of(layout, [rounded(painted(centres()))])
    points = motion(example_set.neutral.points)
    image = Composer(example_set).render(points, same_everywhere(example_set, [1]), motion=motion)
    back = motion.inverse(centres())
    seen = ((back > 1) & (back < [WIDTH - 1, HEIGHT - 1])).all(2)
    assert seen.mean() > 0.7
    assert np.abs(image[seen] - painted(back)[seen]).max() < 2.5


def test_an_affine_motion_of_all_points_is_that_of_the_picture(layout):
    example_set = examples_of(layout, [rounded(painted(centres()))])
    # Not a similarity: the frame around the face follows only nearly, the face's inside exactly.
    points = example_set.neutral.points
    image = Composer(example_set).render(
        points @ MATRIX.T + SHIFT, same_everywhere(example_set, [1])
    )
    back = (centres() - SHIFT) @ np.linalg.inv(MATRIX).T
    inside = core(example_set)
    assert psnr(image[inside], painted(back)[inside]) > 40


def test_plain_colours_mix_exactly(layout):
    colours = np.array([[10, 200, 30], [250, 0, 90], [100, 100, 250]])
    photos = [np.full((HEIGHT, WIDTH, 3), colour, np.uint8) for colour in colours]
    example_set = examples_of(layout, photos)
    row = np.array([0.2, 0.5, 0.3])
    image = Composer(example_set).render(
        example_set.neutral.points, same_everywhere(example_set, row)
    )
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


def test_small_coefficients_left_out_change_little(noisy):
    rng = np.random.default_rng(3)
    skip = 0.02
    coefficients = rng.dirichlet([5, 0.1, 0.1, 3], len(noisy.subregions.names))
    points = noisy.neutral.points
    image = Composer(noisy, skip=skip).render(points, coefficients).astype(int)
    exact = Composer(noisy, skip=0).render(points, coefficients)
    assert 0 < np.abs(image - exact).max() <= 2 * 255 * skip * COUNT + 1


def test_draws_into_memory_that_is_there(noisy):
    out = np.empty_like(noisy.neutral.photo)
    coefficients = same_everywhere(noisy, [0.5, 0.5, 0, 0])
    assert Composer(noisy).render(noisy.neutral.points, coefficients, out=out) is out
    np.testing.assert_array_equal(out, Composer(noisy).render(noisy.neutral.points, coefficients))


def test_a_face_outside_of_the_picture_is_not_drawn(noisy):
    motion = similarity(1, 0, WIDTH, 40)
    points = noisy.neutral.points + np.array([2 * WIDTH, 40])
    image = Composer(noisy).render(points, same_everywhere(noisy, [0, 0, 1, 0]), motion=motion)
    larger, margin = pad_with_blurred_border(noisy.neutral.photo)
    beside = larger[margin : margin + HEIGHT - 40, margin - 20 : margin]
    np.testing.assert_array_equal(image[40:, -20:], beside)


def test_points_outside_of_the_frame_are_accepted(noisy):
    points = noisy.neutral.points + np.array([WIDTH, 0.6 * HEIGHT])
    image = Composer(noisy).render(points, same_everywhere(noisy, [0, 0, 1, 0]))
    np.testing.assert_array_equal(image[:20, :20], noisy.neutral.photo[:20, :20])


def test_points_of_any_size_are_accepted(noisy):
    points = np.array(noisy.neutral.points)
    points[::7] += 1e12
    points[::5] -= 1e300
    composer, coefficients = Composer(noisy), same_everywhere(noisy, [0.5, 0.5, 0, 0])
    composer.render(points, coefficients, size=(33, 1))
    assert composer.render(points, coefficients).shape == noisy.neutral.photo.shape


def test_photos_may_differ_in_size(layout):
    """The second one shows the same at half the size: it gives the same picture, blurred."""
    picture = painted(centres())
    small = painted(2 * centres()[: HEIGHT // 2, : WIDTH // 2])
    example_set = examples_of(layout, [rounded(picture), rounded(small)])
    neutral, half = example_set.examples
    half = Example(half.name, half.photo, neutral.points / 2, "")
    example_set = replace(example_set, examples=(neutral, half))
    image = Composer(example_set).render(neutral.points, same_everywhere(example_set, [0, 1]))
    inside = core(example_set)
    assert psnr(image[inside], picture[inside]) > 35


def test_negative_coefficients_subtract(layout):
    colours = [(10, 200, 30), (50, 100, 90)]
    photos = [np.full((HEIGHT, WIDTH, 3), colour, np.uint8) for colour in colours]
    example_set = examples_of(layout, photos)
    row = np.array([1.25, -0.25])
    image = Composer(example_set).render(
        example_set.neutral.points, same_everywhere(example_set, row)
    )
    inside = image[core(example_set)]
    expected = rounded(np.clip(row @ np.array(colours), 0, 255))
    np.testing.assert_array_equal(inside, np.broadcast_to(expected, inside.shape))


def test_bad_input_is_named(noisy):
    composer, points = Composer(noisy), noisy.neutral.points
    good = same_everywhere(noisy, [1, 0, 0, 0])
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
    with pytest.raises(InputError, match="size"):
        composer.render(points, good, size=(0, 5))
    with pytest.raises(InputError, match="out: expected a writable 7x5 image"):
        composer.render(points, good, size=(7, 5), out=np.empty_like(noisy.neutral.photo))
    with pytest.raises(InputError, match="skip"):
        Composer(noisy, skip=-1)


def test_photos_of_one_row_are_refused(layout, noisy):
    strip = Example("strip", np.zeros((1, 9, 3), np.uint8), noisy.neutral.points, "")
    parts = (noisy.neutral, strip), 0, noisy.statistics, noisy.subregions
    with pytest.raises(InputError, match="two rows"):
        Composer(ExampleSet(layout, *parts))
