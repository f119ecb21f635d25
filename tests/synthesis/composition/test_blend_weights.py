"""Sets of subregions and rounded fades against those that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from mien.synthesis.composition.blend_weights import WEIGHT_UNIT, pack_blend_weights

HEIGHT, WIDTH = 7, 9


@pytest.fixture(params=[3, 12, 70])
def fades(request, rng):
    """Soft ones everywhere, but for the lower rows: one that is alone, and none."""
    drawn = rng.dirichlet(np.full(request.param, 0.1), (HEIGHT, WIDTH)).astype(np.float32)
    drawn *= rng.uniform(0.5, 1, (HEIGHT, WIDTH, 1)).astype(np.float32)
    drawn[4:] = 0
    drawn[4:6, :, 1] = 1
    return drawn


def test_planes_are_the_fades_and_what_is_around(fades):
    planes = pack_blend_weights(fades).planes.astype(int)
    np.testing.assert_array_equal(planes.sum(0), WEIGHT_UNIT)
    around = 1 - fades.sum(2)
    drawn = np.concatenate([fades, around[..., None]], 2).reshape(HEIGHT * WIDTH, -1).T
    error = np.abs(planes / WEIGHT_UNIT - drawn)
    # But for the greatest, which takes what the others leave.
    assert np.sort(error, axis=0)[-2].max() <= 0.5 / WEIGHT_UNIT + 1e-6
    assert error.max() <= len(planes) * 0.5 / WEIGHT_UNIT


def test_sets_are_those_of_a_pixel_and_its_neighbours(fades):
    mapped = pack_blend_weights(fades)
    planes = mapped.planes.reshape(-1, HEIGHT, WIDTH)
    codes = mapped.codes.reshape(HEIGHT, WIDTH)
    for row in range(HEIGHT):
        for col in range(WIDTH):
            expected = np.flatnonzero((planes[:, row : row + 2, col : col + 2] > 0).any((1, 2)))
            code = codes[row, col]
            members = mapped.members[mapped.starts[code] : mapped.starts[code + 1]]
            np.testing.assert_array_equal(members, expected)
            np.testing.assert_array_equal(np.flatnonzero(mapped.holds[code]), expected)


def test_what_is_the_same_has_one_code(fades):
    mapped = pack_blend_weights(fades)
    assert len(np.unique(mapped.holds, axis=0)) == len(mapped.holds)
    codes = mapped.codes.reshape(HEIGHT, WIDTH)
    assert len(np.unique(codes[4])) == len(np.unique(codes[6])) == 1
    assert mapped.holds[codes[4, 0]].sum() == mapped.holds[codes[6, 0]].sum() == 1
