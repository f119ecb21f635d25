from __future__ import annotations

import threading
from collections.abc import Iterator

import numba
import numpy as np
import pytest

from mien.numeric.kernels.threads import for_row_bands, run_concurrently


@pytest.fixture(params=[1, 2])
def threads(request: pytest.FixtureRequest) -> Iterator[int]:
    before = numba.get_num_threads()
    if request.param > before:
        pytest.skip("a machine of one core")
    numba.set_num_threads(request.param)
    yield request.param
    numba.set_num_threads(before)


def test_results_come_in_the_tasks_order(threads: int) -> None:
    first_may_end = threading.Event()

    def first() -> str:
        if threads > 1:
            assert first_may_end.wait(10)
        return "first"

    def second() -> str:
        first_may_end.set()
        return "second"

    assert run_concurrently(first, second) == ["first", "second"]


def test_a_tasks_error_is_the_callers(threads: int) -> None:
    def fail() -> int:
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        run_concurrently(lambda: 1, fail)


def test_tasks_may_share_rows_out(threads: int) -> None:
    """More tasks than threads, each of which waits for row bands, come to an end."""

    def squares() -> np.ndarray:
        out = np.zeros(1000)

        def band(first: int, end: int) -> None:
            out[first:end] = np.arange(first, end) ** 2

        for_row_bands(band, len(out), work=10**6)
        return out

    for found in run_concurrently(*[squares] * 8):
        np.testing.assert_array_equal(found, np.arange(1000) ** 2)
