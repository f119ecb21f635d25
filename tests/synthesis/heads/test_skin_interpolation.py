"""What is known of some of a head's skin, carried over to the rest."""

from __future__ import annotations

import numpy as np

from marbled import GENERIC
from mien.rig.followers import part_vertices
from mien.synthesis.heads.skin_interpolation import behind_lips_and_lids, harmonic_extension

SKIN = part_vertices(GENERIC, "skin")
COUNT = len(GENERIC.mesh.vertices)


def outside():
    known = np.zeros(COUNT, bool)
    known[SKIN] = True
    return known & ~behind_lips_and_lids()


def test_what_is_known_stays(rng):
    values = rng.random((COUNT, 2))
    known = outside()
    np.testing.assert_array_equal(harmonic_extension(values, known)[known], values[known])
    eyes = part_vertices(GENERIC, "left_eyeball", "tongue")
    np.testing.assert_array_equal(harmonic_extension(values, known)[eyes], values[eyes])


def test_what_is_alike_everywhere_is_so_inside_and_on_lashes():
    values = np.where(outside()[:, None], 3.0, np.nan)
    spread = harmonic_extension(np.nan_to_num(values), outside())
    hair = part_vertices(GENERIC, "lashes", "hair")
    np.testing.assert_allclose(spread[np.concatenate([SKIN, hair])], 3)


def test_nothing_goes_beyond_what_is_known(rng):
    values = rng.random((COUNT, 1))
    spread = harmonic_extension(values, outside())
    assert spread.min() >= 0
    assert spread.max() <= 1


def test_a_socket_has_what_the_skin_before_it_has():
    """Height as the value: the middle of an eye socket lies at the height of its eye."""
    height = GENERIC.mesh.vertices[:, 1:2]
    spread = harmonic_extension(height, outside())
    inside = SKIN[GENERIC.regions["eye_socket"][SKIN] >= 0.5]
    assert np.abs(spread[inside] - height[inside]).mean() < 4
