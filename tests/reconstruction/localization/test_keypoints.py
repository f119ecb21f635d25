"""Features of images whose difference is visible."""

from __future__ import annotations

import numpy as np

from marbled import clutter
from mien.reconstruction.localization.keypoints import find_keypoints, match_keypoints

WIDE = clutter(300, 300, 5).astype(np.uint8)


def test_matches_follow_a_shifted_image() -> None:
    one, other = find_keypoints(WIDE[:, :280]), find_keypoints(WIDE[30:, 20:])
    pairs = match_keypoints(one, other)
    assert len(pairs) > 50
    moved = one.points[pairs[:, 0]] - other.points[pairs[:, 1]]
    assert np.median(np.abs(moved - [20, 30])) < 0.1
    np.testing.assert_allclose(np.linalg.norm(one.descriptors, axis=1), 1, rtol=1e-3)


def test_features_lie_within_the_mask() -> None:
    mask = np.zeros(WIDE.shape, bool)
    mask[:, :100] = True
    points = find_keypoints(WIDE, mask).points
    assert len(points) > 20
    assert points[:, 0].max() < 101


def test_nothing_in_a_plain_image() -> None:
    plain = find_keypoints(np.full((100, 100), 128, np.uint8))
    assert len(plain.points) == 0
    assert len(match_keypoints(plain, find_keypoints(WIDE))) == 0
    assert len(match_keypoints(find_keypoints(WIDE), plain)) == 0
