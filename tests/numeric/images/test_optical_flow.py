from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from mien.numeric.images.optical_flow import local_correlation, normalize_contrast, optical_flow

EVERYWHERE = np.ones((160, 200), bool)


def pattern(seed: int = 0) -> np.ndarray:
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(160, 200)), 1.5)
    return np.asarray(128 + 30 * noise / noise.std(), np.float32)


def shifted(image: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Each pixel shows what was `by` (x, y) px further."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(float)
    places = [rows + by[..., 1], columns + by[..., 0]]
    return np.asarray(map_coordinates(image, places, order=3, mode="nearest"), np.float32)


def test_a_known_field_is_found_to_a_tenth_of_a_pixel() -> None:
    image = pattern()
    rows, columns = np.mgrid[:160, :200]
    field = np.stack([2.4 + np.sin(rows / 40), 1.3 * np.cos(columns / 50) - 0.6], axis=-1)
    moved = shifted(image, field)
    a, b = (normalize_contrast(item, EVERYWHERE, 12) for item in (moved, image))
    # What the moved image shows at a pixel is found `field` further in the first.
    miss = np.linalg.norm(optical_flow(a, b) - field, axis=-1)[15:-15, 15:-15]
    assert np.median(miss) < 0.1


def test_gain_bias_and_slow_shading_are_taken_out() -> None:
    image = pattern()
    shading = np.linspace(-25, 25, 200, dtype=np.float32)
    plain = normalize_contrast(image, EVERYWHERE, 10)
    changed = normalize_contrast(0.6 * image + 30 + shading, EVERYWHERE, 10)
    inner = (slice(30, -30), slice(30, -30))
    assert np.corrcoef(plain[inner].ravel(), changed[inner].ravel())[0, 1] > 0.995
    assert abs(float(plain[inner].mean())) < 0.05
    assert 0.6 < float(plain[inner].std()) < 1.1


def test_what_lies_outside_of_the_mask_does_not_matter() -> None:
    image, mask = pattern(), np.zeros((160, 200), bool)
    mask[40:120, 50:150] = True
    other = np.where(mask, image, 255).astype(np.float32)
    a, b = (normalize_contrast(item, mask, 10) for item in (image, other))
    np.testing.assert_allclose(a, b, atol=1e-3)
    assert (a[~mask] == 0).all()


def test_correlation_of_the_same_and_of_others() -> None:
    a, b = (normalize_contrast(pattern(seed), EVERYWHERE, 10) for seed in (0, 1))
    assert local_correlation(a, a)[10:-10, 10:-10].min() > 0.999
    assert abs(np.median(local_correlation(a, b))) < 0.2


def test_flat_images_are_no_error() -> None:
    flat = normalize_contrast(np.full((160, 200), 90, np.float32), EVERYWHERE, 10)
    assert np.abs(flat).max() < 1e-3
    assert np.isfinite(optical_flow(flat, flat)).all()
    assert np.isfinite(local_correlation(flat, flat)).all()


def test_the_same_each_time() -> None:
    a, b = (normalize_contrast(pattern(seed), EVERYWHERE, 10) for seed in (0, 1))
    np.testing.assert_array_equal(optical_flow(a, b), optical_flow(a, b))
