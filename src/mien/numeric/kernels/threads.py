"""Threads for kernels and tasks; results do not depend on their number.

Kernels are Numba functions compiled with `nogil`, called on bands of an image's rows from a pool of
Python threads. Numba's own `parallel=True` takes longer to compile, and its default threading
layer must not be entered by two threads at once.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

import numba

_Result = TypeVar("_Result")

# Pixels of some 10 ns each. Waking a second thread and waiting for it takes 0.05 ms of either's
# time: with less work than this it does not pay.
_SERIAL_WORK = 30_000


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="mien-rows")


def for_row_bands(kernel: Callable[[int, int], object], rows: int, *, work: int) -> None:
    """Call kernel(first_row, end_row) until all rows are done, in as many threads as Numba uses.

    Args:
        kernel: releases the GIL, and writes to its own rows only.
        rows: their number.
        work: estimated cost in pixels, which decides whether threads are used.
    """
    threads = int(numba.get_num_threads()) if work >= _SERIAL_WORK else 1
    if threads == 1:
        kernel(0, rows)
        return
    # More bands than threads balance the load, as costly rows are seldom spread evenly; with
    # little work they cost more than they save.
    bands = min(rows, threads * (4 if work > 20 * _SERIAL_WORK else 1))
    edges = [rows * band // bands for band in range(bands + 1)]
    tasks = [_pool(threads).submit(kernel, *edges[band : band + 2]) for band in range(1, bands)]
    # This thread would be idle.
    kernel(*edges[:2])
    for task in tasks:
        task.result()


def run_concurrently(*tasks: Callable[[], _Result]) -> list[_Result]:
    """The results of tasks that run at once, in as many threads as Numba uses.

    Args:
        tasks: release the GIL most of the time, share nothing that they change, and do not call
            this function.
    """
    threads = int(numba.get_num_threads())
    if threads == 1:
        return [task() for task in tasks]
    # A pool of their own: a task may wait for row bands, which must find idle threads.
    running = [_task_pool(threads).submit(task) for task in tasks]
    return [task.result() for task in running]


@cache
def _task_pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="mien-tasks")
