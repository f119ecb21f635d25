"""A folder of plots of what was tracked, and a page that shows them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.capture.video.video import Video
from mien.errors import InputError
from mien.head import Head
from mien.io.files.atomic import atomic_file, check_file_place
from mien.io.files.image import save_image
from mien.progress import StepProgress, no_step_progress
from mien.render.picture import HeadRenderer
from mien.report.track.charts import Plot, plots_of
from mien.report.track.figures import save_figure
from mien.report.track.overlay import decoded
from mien.report.track.sheet import contact_sheet, evenly_chosen
from mien.track.series import (
    Series,
    rotation_errors,
    series_of,
    translation_errors,
    truth_for,
)
from mien.track.state import Track

PAGE, SHEET = "index.html", "sheet.jpg"
_GENERATOR = "mien plots"
_KINDS = ("png", "svg")
_SHEET_FRAMES = 16


def write_track_plots(
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
        reference: what is known to be true of the same frames; drawn dashed, with errors.
        title: of the page.
        video: that was tracked, and `head`: both for a contact sheet; without them there is none.
        kind: "png" or "svg".
        progress: told the files written and their total.

    Returns:
        the files, the page last.

    Raises:
        InputError: a track without frames, another kind, as decoded, a place that cannot be
            written.
        FileFormatError: not a video.
    """
    if not track.frames:
        raise InputError("track", "at least one frame", "none")
    if kind not in _KINDS:
        raise InputError("kind", " or ".join(_KINDS), kind)
    sheet = () if video is None or head is None else (video, head)
    plots = plots_of(track, reference)
    total = len(plots) + 1 + bool(sheet)
    written: list[Path] = []
    progress(0, total)
    for path in _write_each(Path(folder), track, reference, title, sheet, plots, kind):
        written.append(path)
        progress(len(written), total)
    return tuple(written)


def check_plots_place(folder: str | Path) -> None:
    """Refuse, before any work is done, a folder whose index.html is another's.

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
    """The files, each when it is there."""
    if sheet:
        yield _write_sheet(folder / SHEET, track, *sheet)
    series = series_of(track)
    for plot in plots:
        save_figure(folder / f"{plot.name}.{kind}", plot, series)
        yield folder / f"{plot.name}.{kind}"
    known = [] if reference is None else accuracy(series, truth_for(track, reference))
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
    chosen = evenly_chosen(track, _SHEET_FRAMES)
    save_image(path, contact_sheet(decoded(video, chosen), track, head), quality=90)
    return path


def summary(track: Track, series: Series) -> list[tuple[str, str]]:
    """What a track is in a few numbers, by what they are."""
    counts = {status: series.status.count(status) for status in ("reacquired", "lost")}
    lines = [
        ("pictures", f"{track.width}x{track.height} px, focal length {track.focal_px:.0f} px"),
        ("frames", f"{len(track.frames)}, {track.fps:.2f} a second"),
        ("found anew, lost", f"{counts['reacquired']}, {counts['lost']}"),
    ]
    if not series.lost.all():
        lines.append(("RMS error, grey levels", _told(series.rms, "{:.1f}")))
    return lines


def accuracy(series: Series, truth: Series) -> list[tuple[str, str]]:
    """How far a track is from the truth, by what is compared."""
    lines = [
        ("rotation off by, degrees", _told(rotation_errors(series, truth), "{:.3f}")),
        (
            "translation off by, % of the distance",
            _told(translation_errors(series, truth), "{:.3f}"),
        ),
    ]
    off = [
        np.abs(series.values[name] - truth.values[name])
        for name in series.values
        if name in truth.values and not name.startswith(("gaze.", "units."))
    ]
    if off:
        lines.append(("weights off by", _told(np.concatenate(off), "{:.3f}")))
    return lines


def _told(values: Float[Array, " n"], form: str) -> str:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "not known"
    mean, most = form.format(finite.mean()), form.format(finite.max())
    return f"{mean} on average, {most} at most"


def _page(**content: object) -> str:
    from jinja2 import Environment, PackageLoader

    page = Environment(loader=PackageLoader("mien.report", "."), autoescape=True)
    return page.get_template("track_plots.html.j2").render(**content)
