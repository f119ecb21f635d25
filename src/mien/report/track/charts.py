"""Numbers of a track that are plotted together ([Pighin 2002] figs. 11 to 19)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.track.series import (
    Series,
    quaternions,
    rotation_errors,
    series_of,
    translation_errors,
    truth_for,
)
from mien.track.state import GAZE, Track

_WEIGHTS = (0.0, 1.0)
_MAX_UNITS = 12
_BLINKS = ("units.eyeBlinkLeft", "units.eyeBlinkRight")


@dataclass(frozen=True)
class Row:
    """One curve over the frames.

    Attributes:
        label: with its unit.
        values: (N,).
        deviations: (N,) standard deviations.
        truth: (N,) reference values.
        limits: lowest and highest value that the plot shows at least.
    """

    label: str
    values: Float[Array, " n"]
    deviations: Float[Array, " n"] | None = None
    truth: Float[Array, " n"] | None = None
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Plot:
    """Curves in one figure.

    Attributes:
        name: of its file.
        title: above it.
        caption: below it on the page.
        rows: from top to bottom.
        shared_scale: whether all rows have one scale.
    """

    name: str
    title: str
    caption: str
    rows: tuple[Row, ...]
    shared_scale: bool = False


def build_plots(track: Track, reference: Track | None = None) -> list[Plot]:
    """All plots of a track.

    Args:
        track: that is plotted.
        reference: ground truth of the same frames, if there is any.
    """
    series = series_of(track)
    truth = None if reference is None else truth_for(track, reference)
    plots = [
        _error_plot(series),
        *(_weights_plot(region, track, series, truth) for region in _mixed_regions(track)),
        _units_plot(track, series, truth),
        _eyes_plot(series, truth),
        _rotation_plot(series, truth),
        _quaternion_plot(series, truth),
        _translation_plot(series, truth),
    ]
    return [plot for plot in plots if plot.rows]


def _mixed_regions(track: Track) -> tuple[str, ...]:
    return track.layout.regions if track.layout.weight_channels else ()


def _error_plot(series: Series) -> Plot:
    rows = (
        Row("RMS error, grey levels", series.rms, limits=(0, 1)),
        Row("face seen, %", 100 * series.seen, limits=(0, 100)),
    )
    caption = (
        "Root mean square difference of the frame and the drawn face, from 0 to 255, and how much "
        "of the face is neither covered nor outside of the frame."
    )
    return Plot("rms", "How well the frames are explained", caption, rows)


def _weights_plot(region: str, track: Track, series: Series, truth: Series | None) -> Plot:
    rows = tuple(
        _channel_row(name, f"{region}.{name}", series, truth) for name in track.layout.expressions
    )
    caption = f"Weights of the photographed expressions in the {region} region; they sum to 1."
    return Plot(
        f"weights_{region}", f"Blending weights: {region}", caption, rows, shared_scale=True
    )


def _units_plot(track: Track, series: Series, truth: Series | None) -> Plot:
    """The units that move most; blinks are in the plot of the eyes."""
    names = [f"units.{name}" for name in track.layout.units]
    names = [name for name in names if name not in _BLINKS]
    ranges = [_range(series.values[name]) for name in names]
    chosen = sorted(np.argsort(ranges)[::-1][:_MAX_UNITS].tolist())
    rows = tuple(
        _channel_row(names[index].removeprefix("units."), names[index], series, truth)
        for index in chosen
    )
    which = (
        "" if len(chosen) == len(names) else f" The {len(chosen)} of {len(names)} that move most."
    )
    return Plot("units", "Face units", f"Weights of face units.{which}", rows, shared_scale=True)


def _eyes_plot(series: Series, truth: Series | None) -> Plot:
    labels = ("gaze to the left, °", "gaze up, °")
    gaze = tuple(
        _channel_row(label, name, series, truth, factor=np.degrees(1.0), limits=(-5, 5))
        for label, name in zip(labels, GAZE, strict=True)
    )
    blinks = tuple(
        _channel_row(name.removeprefix("units."), name, series, truth)
        for name in _BLINKS
        if name in series.values
    )
    caption = "Where the eyes look, to the subject's own left and up from straight ahead"
    return Plot("eyes", "Eyes", f"{caption}{', and blinks' if blinks else ''}.", gaze + blinks)


def _rotation_plot(series: Series, truth: Series | None) -> Plot:
    labels = ("yaw, °", "pitch, °", "roll, °")
    rows = _columns(labels, series.angles, None if truth is None else truth.angles)
    if truth is not None:
        rows.append(Row("error, °", rotation_errors(series, truth), limits=(0, 0.1)))
    caption = "The head's, as the camera sees it: to its own left, up, towards its right shoulder."
    return Plot("rotation", "Rotation", caption, tuple(rows))


def _quaternion_plot(series: Series, truth: Series | None) -> Plot:
    rows = _columns("xyzw", quaternions(series), None if truth is None else quaternions(truth))
    caption = (
        "The same as a quaternion ([Pighin 2002] fig. 15); 0, 0, 0, 1 looks straight at the camera."
    )
    return Plot("quaternion", "Rotation as a quaternion", caption, tuple(rows))


def _translation_plot(series: Series, truth: Series | None) -> Plot:
    labels = ("x (right), mm", "y (down), mm", "z (away), mm")
    rows = _columns(labels, series.translations, None if truth is None else truth.translations)
    if truth is not None:
        rows.append(Row("error, %", translation_errors(series, truth), limits=(0, 0.2)))
    caption = "Where the middle between the eyes is, in the camera's space ([Pighin 2002] fig. 16)."
    return Plot("translation", "Translation", caption, tuple(rows))


def _columns(
    labels: Iterable[str], values: Float[Array, "n c"], truth: Float[Array, "n c"] | None
) -> list[Row]:
    true = [None] * values.shape[1] if truth is None else list(truth.T)
    columns = zip(labels, values.T, true, strict=True)
    return [Row(label, column, truth=known) for label, column, known in columns]


def _channel_row(
    label: str,
    channel: str,
    series: Series,
    truth: Series | None,
    *,
    factor: float = 1.0,
    limits: tuple[float, float] = _WEIGHTS,
) -> Row:
    true = None if truth is None else truth.values.get(channel)
    return Row(
        label,
        factor * series.values[channel],
        factor * series.deviations[channel],
        None if true is None else factor * true,
        limits,
    )


def _range(values: Float[Array, " n"]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if len(finite) else 0.0
