"""Asking for memory changes nothing, wherever it is."""

from __future__ import annotations

import numpy as np
from numba import njit

from mien.numeric.kernels.prefetch import prefetch


@njit
def asked(values, index):
    prefetch(values, index)
    return values[0]


def test_any_index_may_be_prefetched():
    for values in (np.arange(5, dtype=np.uint32), np.arange(5.0)):
        for index in (0, 4, 10**6, 10**15):
            assert asked(values, np.uint64(index)) == 0
        np.testing.assert_array_equal(values, np.arange(5))
