"""Progress bars on the terminal: one line a stage, with time left."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mien.build import Progress


@contextmanager
def terminal_progress(quiet: bool) -> Iterator[Progress]:
    """A progress callback that draws bars on stderr while the block runs.

    Args:
        quiet: draw nothing.
    Yields: a function of (stage, done, total); total 0 means "unknown, still at it".
    """
    if quiet:
        yield lambda stage, done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    bars = Bars(
        TextColumn("{task.description:<34}"),
        BarColumn(bar_width=28),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, TaskID] = {}

    def advance(stage: str, done: int, total: int) -> None:
        if not tasks:
            if not _kernels_are_compiled():
                bars.console.print("First run: compiling kernels on the way, once, some 15 s.")
            bars.start()
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total or None)
        bars.update(tasks[stage], completed=done, total=total or None)

    try:
        yield advance
    finally:
        if tasks:
            bars.stop()


def _kernels_are_compiled() -> bool:
    """Whether Numba has kept machine code of mien from an earlier run."""
    place = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(place) if place else Path(__file__).parents[1]
    return next(folder.rglob("*.nbi"), None) is not None
