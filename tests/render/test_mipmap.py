from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from mien.arrays import Array
from mien.errors import InputError
from mien.render.mipmap import (
    Pyramids,
    build_pyramids,
    level_of_detail,
    place_lookup,
    texel_areas,
    weighted_texels,
)


@njit
def lookup(pyramids: Pyramids, texture: int, u: float, v: float, level: float) -> tuple:
    fine, coarse = place_lookup(pyramids, u, v, level)
    return weighted_texels(pyramids.texels, texture, fine, coarse)


def noise(rng: np.random.Generator, height: int = 32, width: int = 64) -> Array:
    return rng.integers(0, 256, (height, width, 3), np.uint8)


def test_a_texels_middle_has_its_colour_and_between_them_they_mix(
    rng: np.random.Generator,
) -> None:
    textures = [noise(rng), noise(rng)]
    pyramids = build_pyramids(textures)
    for index, texture in enumerate(textures):
        at = [(x, y) for x in (0, 17, 63) for y in (0, 9, 31)]
        for x, y in at:
            found = lookup(pyramids, index, (x + 0.5) / 64, 1 - (y + 0.5) / 32, 0.0)
            assert found == tuple(texture[y, x])
        four = texture[9:11, 17:19].astype(float)
        shares = np.array([[0.75 * 0.6, 0.25 * 0.6], [0.75 * 0.4, 0.25 * 0.4]])
        expected = (four * shares[..., None]).sum(axis=(0, 1))
        found = lookup(pyramids, index, 17.75 / 64, 1 - 9.9 / 32, 0.0)
        np.testing.assert_allclose(found, expected, atol=0.1)


def test_u_is_periodic_and_v_is_clamped(rng: np.random.Generator) -> None:
    texture = noise(rng)
    pyramids = build_pyramids([texture])
    seam = (texture[4, 63].astype(float) + texture[4, 0]) / 2
    for u in (0.0, 1.0, -1.0, 2.0):
        np.testing.assert_allclose(lookup(pyramids, 0, u, 1 - 4.5 / 32, 0.0), seam, atol=0.1)
    assert lookup(pyramids, 0, 3.5 / 64, 1.0, 0.0) == tuple(texture[0, 3])
    assert lookup(pyramids, 0, 3.5 / 64, 0.0, 0.0) == tuple(texture[31, 3])


def test_levels_are_means_and_mix(rng: np.random.Generator) -> None:
    texture = noise(rng)
    pyramids = build_pyramids([texture])
    mean = texture[8:10, 20:22].mean(axis=(0, 1))
    u, v = 21 / 64, 1 - 9 / 32
    np.testing.assert_allclose(lookup(pyramids, 0, u, v, 1.0), mean, atol=0.6)
    fine = np.array(lookup(pyramids, 0, 0.4, 0.6, 0.0))
    coarse = np.array(lookup(pyramids, 0, 0.4, 0.6, 1.0))
    between = lookup(pyramids, 0, 0.4, 0.6, 0.3)
    np.testing.assert_allclose(between, 0.7 * fine + 0.3 * coarse, atol=0.2)
    # Past either end the pyramid's end counts.
    assert lookup(pyramids, 0, 0.4, 0.6, -5.0) == tuple(fine)
    assert lookup(pyramids, 0, 0.4, 0.6, 9.0) == lookup(pyramids, 0, 0.4, 0.6, 1.0)


def test_plain_textures_keep_their_colour_exactly(rng: np.random.Generator) -> None:
    for colour in ((255, 255, 255), (0, 255, 1), (254, 0, 127)):
        pyramids = build_pyramids([np.full((64, 64, 3), colour, np.uint8)])
        for u, v, level in rng.uniform(0, 2, (50, 3)):
            assert lookup(pyramids, 0, u, v, level) == colour


def test_level_of_detail_is_the_size_of_texels_in_samples() -> None:
    pyramids = build_pyramids([np.zeros((256, 512, 3), np.uint8)])
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    texels = texel_areas((square / 2)[triangles], pyramids)
    assert texels.sum() == pytest.approx(256 * 128)
    # 256 x 128 texels on 64 x 32 samples: four texels a sample's side.
    detail = level_of_detail(texels, square * [64, 32], triangles)
    np.testing.assert_allclose(detail, 2, atol=1e-6)


def test_bad_textures_are_refused() -> None:
    with pytest.raises(InputError, match="textures: expected at least one, got none"):
        build_pyramids([])
    good = np.zeros((32, 64, 3), np.uint8)
    with pytest.raises(InputError, match=r"texture 1: expected 64x32 px as texture 0 has, got 32x"):
        build_pyramids([good, np.zeros((32, 32, 3), np.uint8)])
    with pytest.raises(InputError, match=r"texture 1: expected an .* uint8 image"):
        build_pyramids([good, good.astype(float)])
