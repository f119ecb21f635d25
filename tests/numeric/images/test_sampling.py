from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.numeric.images.sampling import sample_bilinear


def test_pixel_centres_give_the_pixels(rng: np.random.Generator) -> None:
    image = rng.integers(0, 256, (5, 7, 3), dtype=np.uint8)
    rows, columns = np.mgrid[:5, :7]
    centres = np.column_stack([columns.ravel(), rows.ravel()]) + 0.5
    np.testing.assert_array_equal(sample_bilinear(image, centres), image.reshape(-1, 3))


def test_a_ramp_is_reproduced_between_pixels(rng: np.random.Generator) -> None:
    rows, columns = np.mgrid[:20, :30] + 0.5
    image = np.stack([columns, rows, columns - rows], axis=2).astype(np.float32)
    xy = rng.uniform([0.5, 0.5], [29.5, 19.5], (500, 2))
    expected = np.column_stack([xy, xy[:, 0] - xy[:, 1]])
    np.testing.assert_allclose(sample_bilinear(image, xy), expected, atol=1e-5)


def test_the_image_goes_on_as_it_ends() -> None:
    image = np.arange(4, dtype=np.float32).reshape(2, 2, 1)
    corners = sample_bilinear(image, np.array([[-9.0, -9], [99, -9], [-9, 99], [99, 99]]))
    np.testing.assert_array_equal(corners.ravel(), [0, 1, 2, 3])


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match=r"image: expected an \(h, w, c\) image"):
        sample_bilinear(np.zeros((3, 3)), np.zeros((1, 2)))
    with pytest.raises(InputError, match="xy: expected finite numbers"):
        sample_bilinear(np.zeros((3, 3, 1)), np.array([[np.nan, 0]]))
