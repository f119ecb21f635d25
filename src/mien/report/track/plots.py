"""A folder of plots of a track, with a contact sheet and a page that shows them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.capture.video.video import Video
from mien.errors import InputError
from mien.head import Head
from mien.io.files.atomic import atomic_file, check_file_place
from mien.io.files.image import save_image
from mien.progress import StepProgress, no_step_progress
from mien.render.picture import GREY, HeadRenderer
from mien.render.shade import over_background
from mien.report.sheet import arrange_grid
from mien.report.track.caption import draw_text, mark_lost
from mien.report.track.charts import Plot, build_plots
from mien.report.track.comparison import draw_tracked_head
from mien.report.track.figures import save_figure
from mien.report.track.overlay import decode_tracked_frames
from mien.report.track.window import crop_window
from mien.track.series import (
    Series,
    rotation_errors,
    series_of,
    translation_errors,
    truth_for,
)
from mien.track.state import Track, TrackedFrame

PAGE, SHEET = "index.html", "sheet.jpg"
_GENERATOR = "mien plots"
_KINDS = ("png", "svg")
_SHEET_FRAMES = 16
_CELL = (232, 320)
"""Maximal width and height of a frame on the sheet, px."""
_WHITE = (255, 255, 255)


def save_track_plots(
    folder: str | Path,
    track: Track,
    *,
    reference: Track | None = None,
    title: str = "Track",
    video: str | Path | Video | None = None,
    head: Head | HeadRenderer | None = None,
    kind: str = "png",
    progress: StepProgress = no_step_progress,
) -> tuple[Path, ...]:
    """Write plots like [Pighin 2002]'s figs. 10 to 19 and a page of them, each whole or not at all.

    Args:
        folder: made if there is none; other files in it are left alone.
        track: that is plotted.
        reference: ground truth of the same frames; drawn dashed, with errors.
        title: of the page.
        video: that was tracked; without it or the head there is no contact sheet.
        head: that was tracked.
        kind: "png" or "svg".
        progress: called with the files written and their total.

    Returns:
        The files, the page last.

    Raises:
        InputError: a track without frames, another kind, a place that cannot be written, and as
            decode_tracked_frames.
        FileFormatError: not a video.
    """
    if not track.frames:
        raise InputError("track", "at least one frame", "none")
    if kind not in _KINDS:
        raise InputError("kind", " or ".join(_KINDS), kind)
    sheet = () if video is None or head is None else (video, head)
    plots = build_plots(track, reference)
    total = len(plots) + 1 + bool(sheet)
    written: list[Path] = []
    progress(0, total)
    for path in _write_each(Path(folder), track, reference, title, sheet, plots, kind):
        written.append(path)
        progress(len(written), total)
    return tuple(written)


def check_plots_place(folder: str | Path) -> None:
    """Refuse, before any work is done, a folder with an index.html that mien did not write.

    Args:
        folder: of the plots.

    Raises:
        InputError: that; a place that cannot be written.
    """
    page = Path(folder) / PAGE
    if page.is_file() and _GENERATOR.encode() not in page.read_bytes():
        raise InputError(page, "a free place for the page of plots", "another page")
    check_file_place(page)


def _write_each(
    folder: Path,
    track: Track,
    reference: Track | None,
    title: str,
    sheet: tuple[()] | tuple[str | Path | Video, Head | HeadRenderer],
    plots: list[Plot],
    kind: str,
) -> Iterator[Path]:
    """Write the files and yield the path of each when it is there."""
    if sheet:
        yield _write_sheet(folder / SHEET, track, *sheet)
    series = series_of(track)
    for plot in plots:
        save_figure(folder / f"{plot.name}.{kind}", plot, series)
        yield folder / f"{plot.name}.{kind}"
    known = [] if reference is None else error_summary(series, truth_for(track, reference))
    page = _page(
        generator=_GENERATOR,
        title=title,
        summary=summary(track, series) + known,
        sheet=SHEET if sheet else "",
        plots=plots,
        kind=kind,
    )
    with atomic_file(folder / PAGE) as temporary:
        temporary.write_text(page, encoding="utf-8")
    yield folder / PAGE


def _write_sheet(
    path: Path, track: Track, video: str | Path | Video, head: Head | HeadRenderer
) -> Path:
    chosen = pick_evenly(track, _SHEET_FRAMES)
    save_image(path, contact_sheet(decode_tracked_frames(video, chosen), track, head), quality=90)
    return path


def pick_evenly(track: Track, count: int) -> Track:
    """The track with only so many of its frames, evenly spaced from the first to the last."""
    last = len(track.frames) - 1
    chosen = np.unique(np.rint(np.linspace(0, last, min(count, last + 1))).astype(int))
    return replace(track, frames=tuple(track.frames[index] for index in chosen))


def contact_sheet(
    frames: Iterable[tuple[UInt8[Array, "h w 3"], TrackedFrame]],
    track: Track,
    head: Head | HeadRenderer,
    *,
    columns: int = 8,
) -> UInt8[Array, "h w 3"]:
    """A sheet of frames, each above the drawn head, cropped to the bounds of the head.

    Args:
        frames: as for overlay_frames; one at least.
        track: that they are of.
        head: that was tracked.
        columns: how many frames in a row.

    Source:
        [Pighin 2002] figs. 10 and 17.
    """
    renderer = head if isinstance(head, HeadRenderer) else HeadRenderer(head)
    window = crop_window(track, renderer.head, _CELL)
    cells = []
    for pixels, tracked in frames:
        camera = None if tracked.state is None else window.camera(track, tracked.state)
        drawn = draw_tracked_head(renderer, track, tracked, camera)
        frame = window.crop(pixels, track)
        if drawn is None:
            below = mark_lost(np.full_like(frame, GREY))
        else:
            below = over_background(drawn.picture, GREY)[..., :3]
        above = draw_text(frame, str(tracked.frame), _WHITE, at=(0.12, 0.06), size=15, outline=2)
        cells.append(np.concatenate([above, below]))
    return arrange_grid(cells, columns)


def summary(track: Track, series: Series) -> list[tuple[str, str]]:
    """Labels and values of a track's key figures."""
    counts = {status: series.status.count(status) for status in ("reacquired", "lost")}
    lines = [
        ("pictures", f"{track.width}x{track.height} px, focal length {track.focal_px:.0f} px"),
        ("frames", f"{len(track.frames)}, {track.fps:.2f} a second"),
        ("found anew, lost", f"{counts['reacquired']}, {counts['lost']}"),
    ]
    if not series.lost.all():
        lines.append(("RMS error, grey levels", _mean_and_max(series.rms, "{:.1f}")))
    return lines


def error_summary(series: Series, truth: Series) -> list[tuple[str, str]]:
    """Labels and values of a track's errors against the truth."""
    lines = [
        ("rotation off by, degrees", _mean_and_max(rotation_errors(series, truth), "{:.3f}")),
        (
            "translation off by, % of the distance",
            _mean_and_max(translation_errors(series, truth), "{:.3f}"),
        ),
    ]
    errors = [
        np.abs(series.values[name] - truth.values[name])
        for name in series.values
        if name in truth.values and not name.startswith(("gaze.", "units."))
    ]
    if errors:
        lines.append(("weights off by", _mean_and_max(np.concatenate(errors), "{:.3f}")))
    return lines


def _mean_and_max(values: Float[Array, " n"], template: str) -> str:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "not known"
    mean, most = template.format(finite.mean()), template.format(finite.max())
    return f"{mean} on average, {most} at most"


def _page(**content: object) -> str:
    from jinja2 import Environment, PackageLoader

    page = Environment(loader=PackageLoader("mien.report", "."), autoescape=True)
    return page.get_template("track_plots.html.j2").render(**content)
