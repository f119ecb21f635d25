"""Progress bars on the terminal: one line a stage, with remaining time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mien.progress import Progress, no_progress

if TYPE_CHECKING:
    from rich.progress import Task


_COMPILING = "First run: compiling kernels on the way, once, some 15 s."
_COMPILING_EVERY_TIME = (
    "Compiling kernels on the way, some 15 s: no folder to keep them can be written to. "
    "NUMBA_CACHE_DIR may name one."
)


@contextmanager
def terminal_progress(quiet: bool, *, counted: Collection[str] = ()) -> Iterator[Progress]:
    """A progress callback that draws bars on stderr while the block runs.

    Args:
        quiet: draw nothing.
        counted: stages whose steps are frames; their rate is shown.

    Yields:
        a function of (stage, done, total); total 0 means unknown.
    """
    if quiet:
        yield no_progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    from mien.numeric.kernels import cache as kernel_files

    bars = Bars(
        TextColumn("{task.description:<34}"),
        BarColumn(bar_width=28),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[speed]}"),
        console=Console(stderr=True),
    )
    tasks: dict[str, TaskID] = {}

    def advance(stage: str, done: int, total: int) -> None:
        if not tasks:
            if not kernel_files.kernels_are_kept():
                places = kernel_files.kernel_folders()
                bars.console.print(_COMPILING if places else _COMPILING_EVERY_TIME)
            bars.start()
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total or None, speed="")
        bars.update(tasks[stage], completed=done, total=total or None)
        if stage in counted:
            bars.update(tasks[stage], speed=_speed(bars.tasks[tasks[stage]]))

    try:
        yield advance
    finally:
        if tasks:
            bars.stop()


def _speed(task: Task) -> str:
    """Rate over the last half-minute, without frames of an earlier run."""
    return f"{task.speed:.1f} frames/s" if task.speed else ""
