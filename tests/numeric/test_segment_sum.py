from __future__ import annotations

import numpy as np

from mien.numeric.segment_sum import SegmentSum


def test_sums_are_those_of_the_members() -> None:
    rng = np.random.default_rng(0)
    group, values = rng.integers(5, size=40), rng.normal(size=(40, 2, 3))
    sums = SegmentSum(group, 7)(values)
    expected = np.stack([values[group == g].sum(axis=0) for g in range(7)])
    np.testing.assert_allclose(sums, expected, atol=1e-12)
    assert sums.shape == (7, 2, 3)


def test_no_members_at_all() -> None:
    sums = SegmentSum(np.zeros(0, int), 3)(np.zeros((0, 2, 7)))
    np.testing.assert_array_equal(sums, np.zeros((3, 2, 7)))
