"""How far a track lies from the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mien.arrays import Array, Float
from mien.expressions.rig import Rig
from mien.numeric.rotation import angle_between
from mien.track.state import Track, TrackState

__all__ = ["rotation_errors", "shape_errors", "translation_errors", "weight_errors"]

_Error = Callable[[TrackState, TrackState], float]


def rotation_errors(found: Track, true: Track) -> Float[Array, " n"]:
    """(N,) degrees; NaN where the frame is lost."""
    return _over_frames(
        found, true, lambda a, b: float(np.degrees(angle_between(a.R_cam_head, b.R_cam_head)))
    )


def translation_errors(found: Track, true: Track) -> Float[Array, " n"]:
    """(N,) percent of the head's true distance; NaN where the frame is lost."""

    def error(a: TrackState, b: TrackState) -> float:
        off = np.linalg.norm(a.t_cam_head - b.t_cam_head)
        return float(100 * off / np.linalg.norm(b.t_cam_head))

    return _over_frames(found, true, error)


def weight_errors(found: Track, true: Track) -> Float[Array, "n r"]:
    """(N, R) mean absolute error over the expressions of either, by the truth's regions.

    What only one of them knows has weight 0 in the other. NaN where the frame is lost.
    """
    names = tuple(dict.fromkeys((*true.layout.expressions, *found.layout.expressions)))
    rows = np.full((len(true.frames), len(true.layout.regions)), np.nan)
    for index, (a, b) in _pairs(found, true):
        for column, region in enumerate(true.layout.regions):
            given, wanted = (_row(t, s, region) for t, s in ((found, a), (true, b)))
            off = [abs(given.get(name, 0.0) - wanted.get(name, 0.0)) for name in names]
            rows[index, column] = np.mean(off)
    return rows


def shape_errors(
    found: Track, true: Track, rigs: tuple[Rig, Rig], mask: Float[Array, " v"]
) -> Float[Array, " n"]:
    """(N,) mm: mean distance of the masked vertices in head space; NaN where the frame is lost.

    Mixtures that look alike may have weights that differ; this tells whether they do look alike.

    Args:
        rigs: of the found and of the true head. mask: (V,) weights of the vertices.
    """

    def error(a: TrackState, b: TrackState) -> float:
        faces = [
            rig.evaluate(state.face(track.layout)).vertices
            for rig, state, track in zip(rigs, (a, b), (found, true), strict=True)
        ]
        return float(np.average(np.linalg.norm(faces[0] - faces[1], axis=1), weights=mask))

    return _over_frames(found, true, error)


def _over_frames(found: Track, true: Track, error: _Error) -> Float[Array, " n"]:
    errors = np.full(len(true.frames), np.nan)
    for index, (a, b) in _pairs(found, true):
        errors[index] = error(a, b)
    return errors


def _pairs(found: Track, true: Track) -> Iterator[tuple[int, tuple[TrackState, TrackState]]]:
    """Row of the truth, and both states, of every frame that is found."""
    states = {frame.frame: frame.state for frame in found.frames}
    for index, frame in enumerate(true.frames):
        state = states.get(frame.frame)
        if state is not None and frame.state is not None:
            yield index, (state, frame.state)


def _row(track: Track, state: TrackState, region: str) -> dict[str, float]:
    """Weights of a region by expression; all neutral where the track does not divide so."""
    if region not in track.layout.regions:
        return {track.layout.expressions[0]: 1.0}
    row = state.weights[track.layout.regions.index(region)]
    return dict(zip(track.layout.expressions, row.tolist(), strict=True))
