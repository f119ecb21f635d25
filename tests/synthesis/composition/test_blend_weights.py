"""Sets of subregions and rounded weights against those that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from mien.synthesis.composition.blend_weights import WEIGHT_UNIT, pack_blend_weights

HEIGHT, WIDTH = 7, 9


@pytest.fixture(params=[3, 12, 70])
def weights(request, rng):
    """Soft ones everywhere except in the lower rows: one region alone, and none."""
    drawn = rng.dirichlet(np.full(request.param, 0.1), (HEIGHT, WIDTH)).astype(np.float32)
    drawn *= rng.uniform(0.5, 1, (HEIGHT, WIDTH, 1)).astype(np.float32)
    drawn[4:] = 0
    drawn[4:6, :, 1] = 1
    return drawn


def test_planes_are_the_weights_and_that_of_the_background(weights):
    planes = pack_blend_weights(weights).planes.astype(int)
    np.testing.assert_array_equal(planes.sum(0), WEIGHT_UNIT)
    background = 1 - weights.sum(2)
    drawn = np.concatenate([weights, background[..., None]], 2).reshape(HEIGHT * WIDTH, -1).T
    error = np.abs(planes / WEIGHT_UNIT - drawn)
    # Except for the greatest, which takes the rounding error.
    assert np.sort(error, axis=0)[-2].max() <= 0.5 / WEIGHT_UNIT + 1e-6
    assert error.max() <= len(planes) * 0.5 / WEIGHT_UNIT


def test_sets_are_those_of_a_pixel_and_its_neighbours(weights):
    packed = pack_blend_weights(weights)
    planes = packed.planes.reshape(-1, HEIGHT, WIDTH)
    codes = packed.codes.reshape(HEIGHT, WIDTH)
    for row in range(HEIGHT):
        for col in range(WIDTH):
            expected = np.flatnonzero((planes[:, row : row + 2, col : col + 2] > 0).any((1, 2)))
            code = codes[row, col]
            members = packed.members[packed.starts[code] : packed.starts[code + 1]]
            np.testing.assert_array_equal(members, expected)
            np.testing.assert_array_equal(np.flatnonzero(packed.table[code]), expected)


def test_equal_sets_have_one_code(weights):
    packed = pack_blend_weights(weights)
    assert len(np.unique(packed.table, axis=0)) == len(packed.table)
    codes = packed.codes.reshape(HEIGHT, WIDTH)
    assert len(np.unique(codes[4])) == len(np.unique(codes[6])) == 1
    assert packed.table[codes[4, 0]].sum() == packed.table[codes[6, 0]].sum() == 1
