"""How a long computation reports its progress."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Progress", "StepProgress", "no_progress", "no_step_progress", "stage_progress"]

Progress = Callable[[str, int, int], None]
"""Called with the stage, the steps done and their total; a total of 0 means unknown."""

StepProgress = Callable[[int, int], None]
"""The same within one stage: called with the steps done and their total."""


def no_progress(stage: str, done: int, total: int) -> None:
    """A Progress that reports nothing."""


def no_step_progress(done: int, total: int) -> None:
    """A StepProgress that reports nothing."""


def stage_progress(progress: Progress, stage: str) -> StepProgress:
    """The StepProgress of one stage."""
    return lambda done, total: progress(stage, done, total)
