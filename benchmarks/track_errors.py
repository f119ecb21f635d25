"""How far a track's faces lie from the true ones (its poses: mien.track.series)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.arrays import Array, Float
from mien.rig.rig import Rig
from mien.track.state import Track, TrackState

__all__ = ["shape_errors", "weight_errors"]


def weight_errors(found: Track, true: Track) -> Float[Array, "n r"]:
    """(N, R) mean absolute error over the expressions of either, by the truth's regions.

    What only one of them knows has weight 0 in the other. NaN where the frame is lost.
    """
    names = tuple(dict.fromkeys((*true.layout.expressions, *found.layout.expressions)))
    rows = np.full((len(true.frames), len(true.layout.regions)), np.nan)
    for index, a, b in _pairs(found, true):
        for column, region in enumerate(true.layout.regions):
            given, wanted = _row(found, a, region), _row(true, b, region)
            off = [abs(given.get(name, 0.0) - wanted.get(name, 0.0)) for name in names]
            rows[index, column] = np.mean(off)
    return rows


def shape_errors(
    found: Track, true: Track, rigs: tuple[Rig, Rig], mask: Float[Array, " v"]
) -> Float[Array, " n"]:
    """(N,) mm: mean distance of the masked vertices in head space; NaN where the frame is lost.

    Mixtures that look alike may have weights that differ; this tells whether they do look alike.

    Args:
        rigs: of the found and of the true head.
        mask: (V,) weights of the vertices.
    """
    errors = np.full(len(true.frames), np.nan)
    for index, a, b in _pairs(found, true):
        first, second = (
            rig.evaluate(state.face(track.layout)).vertices
            for rig, state, track in zip(rigs, (a, b), (found, true), strict=True)
        )
        errors[index] = np.average(np.linalg.norm(first - second, axis=1), weights=mask)
    return errors


def _pairs(found: Track, true: Track) -> Iterator[tuple[int, TrackState, TrackState]]:
    """Row of the truth, and both states, of every frame that is found."""
    states = {frame.frame: frame.state for frame in found.frames}
    for index, frame in enumerate(true.frames):
        state = states.get(frame.frame)
        if state is not None and frame.state is not None:
            yield index, state, frame.state


def _row(track: Track, state: TrackState, region: str) -> dict[str, float]:
    """Weights of a region by expression; all neutral where the track does not divide so."""
    if region not in track.layout.regions:
        return {track.layout.expressions[0]: 1.0}
    row = state.weights[track.layout.regions.index(region)]
    return dict(zip(track.layout.expressions, row.tolist(), strict=True))
