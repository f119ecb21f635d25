from __future__ import annotations

from dataclasses import replace

import numpy as np

from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.problem import BundleState, CameraPrior, FocalGroups
from mien.reconstruction.bundle.projection import POSE_SIZE
from mien.reconstruction.dense.joint import POSE_DEVIATION
from observed import observed

SCENE = observed(0, (-20, 0, 20))
TWO_LENSES = FocalGroups(np.array([1, 0, 1]), np.log([2000.0, 3000.0]), np.array([0.1, 0.2]))


def test_photos_of_one_lens_share_its_unknown(rng: np.random.Generator) -> None:
    by_photo = rng.normal(size=(4, 3, 7))
    by_unknown = TWO_LENSES.sum_by_unknown(by_photo)
    np.testing.assert_array_equal(by_unknown[:, :18], by_photo[..., :6].reshape(4, 18))
    np.testing.assert_allclose(by_unknown[:, 18], by_photo[:, 1, 6])
    np.testing.assert_allclose(by_unknown[:, 19], by_photo[:, 0, 6] + by_photo[:, 2, 6])


def test_matrices_of_photos_join(rng: np.random.Generator) -> None:
    """The quadratic form of the joined matrix is the sum of the photos' own."""
    blocks, unknowns = rng.normal(size=(3, 7, 7)), rng.normal(size=20)
    own = np.column_stack([unknowns[:18].reshape(3, 6), unknowns[18:][TWO_LENSES.group]])
    expected = np.einsum("ka,kab,kb->", own, blocks, own)
    np.testing.assert_allclose(unknowns @ TWO_LENSES.join_blocks(blocks) @ unknowns, expected)


def test_a_shared_lens_starts_at_the_mean_and_is_given_to_all() -> None:
    cameras = [
        replace(item, focal_px=focal)
        for item, focal in zip(SCENE.cameras, (2000.0, 1500.0, 4500.0), strict=True)
    ]
    state = BundleState.of(cameras, SCENE.points, TWO_LENSES.group, 4)
    found = [item.focal_px for item in state.cameras(cameras, TWO_LENSES.group)]
    np.testing.assert_allclose(found, [3000, 1500, 3000])


def test_a_step_and_its_deviation_from_the_prior() -> None:
    """Camera steps have the units of the prior's deviations."""
    state = BundleState.of(SCENE.cameras, SCENE.points, SCENE.focal().group, 4)
    prior = CameraPrior(state.R, state.t, SCENE.focal(), POSE_DEVIATION)
    common = np.zeros(3 * POSE_SIZE + 3 + 4)
    common[:POSE_SIZE], common[POSE_SIZE : 2 * POSE_SIZE] = 0.5 * POSE_DEVIATION, -POSE_DEVIATION
    common[18:21], common[21:] = 0.02, 1.5
    moved = state.moved(common, np.ones_like(state.points))
    np.testing.assert_allclose(prior.deviations(state), 0, atol=1e-12)
    np.testing.assert_allclose(prior.deviations(moved), common[:21], atol=1e-12)
    np.testing.assert_allclose(moved.coefficients, 1.5)
    np.testing.assert_allclose(moved.points, SCENE.points + 1)
    turned = rotation_from_vector(0.5 * POSE_DEVIATION[:3]) @ SCENE.cameras[0].R_cam_head
    np.testing.assert_allclose(moved.R[0], turned)
    half = state.moved(common, np.ones_like(state.points), 0.5)
    np.testing.assert_allclose(prior.deviations(half), common[:21] / 2, atol=1e-12)
