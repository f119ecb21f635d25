from __future__ import annotations

import numpy as np

from marbled import GENERIC
from mien.reconstruction.dense.prior import (
    ASYMMETRIC_SD_MM,
    SYMMETRIC_SD_MM,
    load_head_prior,
    make_head_prior,
)

PRIOR = load_head_prior()
MIRROR = np.array([-1.0, 1.0, 1.0])
FACE = GENERIC.regions["face"] > 0.5


def test_the_mean_is_the_generic_head() -> None:
    np.testing.assert_array_equal(
        PRIOR.vertices(np.zeros(len(PRIOR.components))), GENERIC.mesh.vertices
    )


def test_no_component_moves_turns_or_scales_the_face() -> None:
    vertices, weight = GENERIC.mesh.vertices, GENERIC.regions["face"][:, None]
    moved = (PRIOR.components * weight).sum(axis=1)
    scaled = (PRIOR.components * weight * vertices).sum(axis=(1, 2))
    turned = (np.cross(vertices, PRIOR.components) * weight).sum(axis=1)
    size = np.abs(PRIOR.components * weight).sum(axis=(1, 2))[:, None]
    assert (np.abs(moved) < 1e-6 * size).all()
    assert (np.abs(turned) < 1e-4 * size).all()
    assert (np.abs(scaled) < 1e-4 * size[:, 0]).all()


def test_modes_are_symmetric_or_asymmetric() -> None:
    modes = PRIOR.components[PRIOR.identity_count :]
    mirrored = modes[:, GENERIC.mirror] * MIRROR
    # The generic head is its own mirror image to a few hundredths of a millimetre.
    even = np.abs(modes - mirrored)[:, FACE].max(axis=(1, 2))
    odd = np.abs(modes + mirrored)[:, FACE].max(axis=(1, 2))
    assert (np.minimum(even, odd) < 0.05).all()
    assert 100 < np.count_nonzero(even < odd) < 140


def test_variance_is_what_it_is_said_to_be() -> None:
    """Less what the frame takes and what the modes leave out."""
    modes = PRIOR.components[PRIOR.identity_count :, FACE]
    variance = (modes**2).sum(axis=(0, 2))
    whole = 3 * (SYMMETRIC_SD_MM**2 + ASYMMETRIC_SD_MM**2)
    assert 0.4 * whole < np.median(variance) < 1.2 * whole


def test_the_same_each_time() -> None:
    np.testing.assert_array_equal(make_head_prior(GENERIC).components, PRIOR.components)
