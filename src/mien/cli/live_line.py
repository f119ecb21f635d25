"""Live tracking on the terminal: one line that changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mien.pipelines.tracking.live_loop import LiveStatus, LiveSummary


@contextmanager
def live_line(quiet: bool) -> Iterator[Callable[[LiveStatus], None]]:
    """A function that shows a status on stderr while the block runs, if that is a terminal."""
    from rich.console import Console
    from rich.live import Live

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda status: None
        return
    with Live("getting ready | Ctrl-C stops", console=console, transient=True) as line:
        yield lambda status: line.update(status_text(status))


def status_text(status: LiveStatus) -> str:
    """`frame 120 | 29.8 frames/s | 41 ms | ok | 3 dropped | Ctrl-C stops`."""
    parts = (
        f"frame {status.frame}",
        f"{status.fps:.1f} frames/s",
        f"{1000 * status.latency:.0f} ms",
        status.status,
        f"{status.dropped} dropped",
        "Ctrl-C stops",
    )
    return " | ".join(parts)


def summary_text(summary: LiveSummary) -> str:
    """`300 frames, 29.8 a second, 4 lost, 3 pictures dropped, 41 ms from picture to packet`."""
    text = (
        f"{summary.frames} frames, {summary.fps:.1f} a second, {summary.lost} lost, "
        f"{summary.dropped} pictures dropped"
    )
    if summary.latency is None:
        return text
    return f"{text}, {1000 * summary.latency:.0f} ms from picture to packet"
