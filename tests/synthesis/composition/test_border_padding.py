"""The border that is added around a photo."""

from __future__ import annotations

import numpy as np
import pytest

from mien.synthesis.composition.border_padding import pad_with_blurred_border


@pytest.fixture
def photo(rng):
    """An edge of stripes and a bright spot in the middle."""
    picture = rng.integers(60, 190, (60, 90, 3)).astype(np.uint8)
    picture[30, 45] = 255
    return picture


def test_the_photo_lies_in_the_middle(photo):
    larger, margin = pad_with_blurred_border(photo)
    assert larger.shape == (60 + 2 * margin, 90 + 2 * margin, 3)
    np.testing.assert_array_equal(larger[margin:-margin, margin:-margin], photo)


def test_a_photo_of_one_colour_is_continued():
    larger, _ = pad_with_blurred_border(np.full((20, 30, 3), (10, 128, 255), np.uint8))
    assert (larger == (10, 128, 255)).all()


def test_the_border_joins_the_photo_and_loses_its_stripes(photo):
    """Along lines beside the edge, neighbours differ less the farther they are from it."""
    larger, margin = pad_with_blurred_border(photo)
    rows = larger[margin - np.arange(margin), margin : margin + 90].astype(float)
    np.testing.assert_allclose(rows[1], photo[0], atol=40)
    stripes = np.abs(np.diff(rows, axis=1)).mean(axis=(1, 2))
    assert stripes[1] > 0.5 * stripes[0]
    assert stripes[4] < 0.3 * stripes[0]
    assert stripes[-1] < 2


def test_colours_outside_are_continuous():
    """Between neighbours, nothing outside changes more than the edge of a smooth photo does."""
    y, x = np.mgrid[:60, :90]
    photo = np.stack([2 * x, 2 * y, 90 + x - y], axis=2).astype(np.uint8)
    larger, _ = pad_with_blurred_border(photo)
    for axis in (0, 1):
        assert np.abs(np.diff(larger.astype(int), axis=axis)).max() <= 6


@pytest.mark.parametrize("shape", [(2, 2), (3, 200), (1, 1)])
def test_small_photos(shape):
    larger, margin = pad_with_blurred_border(np.full((*shape, 3), 77, np.uint8))
    assert margin >= 1
    assert (larger == 77).all()
