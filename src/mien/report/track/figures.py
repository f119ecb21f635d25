"""Plots of a track as image files."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mien.arrays import Array, Bool
from mien.io.files.atomic import atomic_file
from mien.report.track.charts import Plot, Row
from mien.track.series import Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, safe for the colour-blind; the truth is dashed in addition.
_TRACKED, _TRUTH, _REACQUIRED, _LOST = "#0072B2", "#1a1a1a", "#D55E00", "#d9d9d9"
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.grid": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.6,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelcolor": "#333333",
    "ytick.labelcolor": "#333333",
    "svg.hashsalt": "mien",
    "text.parse_math": False,
}
_WIDTH, _ROW, _ABOVE, _BELOW = 10.0, 0.82, 0.6, 0.5
"""Inches: of the whole, of a row, and of what is above and below the rows."""
_LEFT, _RIGHT = 2.0, 0.2
_DPI = 130
_MANY_FRAMES = 2000
"""With so many frames or more, lines are thin."""
_MARGIN = 0.06
"""Above and below a row's numbers, as a share of their range."""


def save_figure(path: str | Path, plot: Plot, series: Series) -> None:
    """Write a plot, whole or not at all.

    Args:
        path: .png or .svg.
        plot: that is drawn.
        series: of the track that it is of.

    Raises:
        InputError: a place that cannot be written.
    """
    import matplotlib

    kind = Path(path).suffix[1:]
    with (
        matplotlib.rc_context(_STYLE),
        warnings.catch_warnings(),
        atomic_file(path) as temporary,
    ):
        # An expression may have a name in any script; what the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        # Without a date the same track gives the same file.
        metadata = {"Date": None} if kind == "svg" else {}
        _draw(plot, series).savefig(temporary, format=kind, dpi=_DPI, metadata=metadata)


def _draw(plot: Plot, series: Series) -> Figure:
    from matplotlib.figure import Figure

    count = len(plot.rows)
    height = _ABOVE + count * _ROW + _BELOW
    figure = Figure(figsize=(_WIDTH, height), facecolor="white")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    figure.subplots_adjust(
        left=_LEFT / _WIDTH,
        right=1 - _RIGHT / _WIDTH,
        top=1 - _ABOVE / height,
        bottom=_BELOW / height,
        hspace=0.28,
    )
    for axis, row, limits in zip(axes, plot.rows, row_limits(plot), strict=True):
        _draw_row(axis, row, series)
        axis.set_ylim(*limits)
    first, last = series.numbers[[0, -1]].tolist()
    axes[-1].set(xlabel="frame", xlim=(first - 0.5, last + 0.5))
    axes[-1].locator_params(axis="x", integer=True)
    top = 1 - 0.22 / height
    figure.text(0.015, top, plot.title, size=12, weight="bold", va="center", color="#222222")
    _add_legend(figure, plot, series, top)
    return figure


def _draw_row(axis: Axes, row: Row, series: Series) -> None:
    frames, values = series.numbers, row.values
    for first, end in true_runs(series.lost):
        axis.axvspan(frames[first] - 0.5, frames[end - 1] + 0.5, color=_LOST, lw=0)
    for frame in frames[_reacquired(series)].tolist():
        axis.axvline(frame, ymin=0.8, color=_REACQUIRED, lw=1.2)
    if row.deviations is not None:
        low, high = values - row.deviations, values + row.deviations
        axis.fill_between(frames, low, high, color=_TRACKED, alpha=0.22, lw=0)
    width = 1.4 if len(frames) < _MANY_FRAMES else 0.7
    axis.plot(frames, values, color=_TRACKED, lw=width, solid_joinstyle="round")
    isolated = _isolated(np.isfinite(values))
    axis.plot(frames[isolated], values[isolated], "o", color=_TRACKED, ms=3)
    if row.truth is not None:
        axis.plot(frames, row.truth, color=_TRUTH, lw=1.1, dashes=(4, 2.5))
    axis.locator_params(axis="y", nbins=4)
    axis.tick_params(length=2)
    axis.set_axisbelow(True)
    axis.set_ylabel(row.label, rotation=0, ha="right", va="center", labelpad=8, color="#222222")
    axis.yaxis.set_label_coords(-0.058, 0.5)


def _add_legend(figure: Figure, plot: Plot, series: Series, top: float) -> None:
    """The legend of the lines and colours that occur."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [Line2D([], [], color=_TRACKED, lw=1.6, label="tracked")]
    if any(row.deviations is not None for row in plot.rows):
        handles.append(Patch(color=_TRACKED, alpha=0.22, lw=0, label="± one standard deviation"))
    if any(row.truth is not None for row in plot.rows):
        handles.append(Line2D([], [], color=_TRUTH, lw=1.1, dashes=(4, 2.5), label="truth"))
    if series.lost.any():
        handles.append(Patch(color=_LOST, lw=0, label="lost"))
    if _reacquired(series).any():
        handles.append(Line2D([], [], color=_REACQUIRED, lw=1.2, label="found anew"))
    figure.legend(
        handles=handles,
        loc="center right",
        bbox_to_anchor=(1 - _RIGHT / _WIDTH, top),
        ncols=len(handles),
        frameon=False,
        handlelength=1.8,
        columnspacing=1.6,
        borderaxespad=0,
    )


def row_limits(plot: Plot) -> list[tuple[float, float]]:
    """The lowest and highest value that each row shows: all of its numbers and of the truth.

    A deviation, where hardly anything is known, may reach out of it.
    """
    limits = []
    for row in plot.rows:
        shown = np.concatenate([row.values, () if row.truth is None else row.truth])
        shown = np.concatenate([shown[np.isfinite(shown)], row.limits or ()])
        low, high = (shown.min(), shown.max()) if len(shown) else (0.0, 1.0)
        limits.append((float(low), float(high)))
    if plot.shared_scale:
        limits = [(min(low for low, _ in limits), max(high for _, high in limits))] * len(limits)
    margins = [_MARGIN * (high - low) or 0.5 for low, high in limits]
    return [
        (low - margin, high + margin) for (low, high), margin in zip(limits, margins, strict=True)
    ]


def true_runs(mask: Bool[Array, " n"]) -> Iterator[tuple[int, int]]:
    """First index, and the one after the last, of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _reacquired(series: Series) -> Bool[Array, " n"]:
    return np.array([status == "reacquired" for status in series.status], bool)


def _isolated(finite: Bool[Array, " n"]) -> Bool[Array, " n"]:
    """Numbers between two that are not finite: a line would not show them."""
    padded = np.pad(finite, 1)
    return finite & ~padded[:-2] & ~padded[2:]
