"""Tracks whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.camera import FRONTAL
from mien.numeric.rotation import rotation_from_vector
from mien.track.state import Layout, Status, Track, TrackedFrame, TrackState

LAYOUT = Layout(("mouth", "eyes"), ("neutral", "joy", "anger"), ("jawOpen", "eyeBlinkLeft"))


def random_state(rng: np.random.Generator, layout: Layout = LAYOUT) -> TrackState:
    """A head that roughly faces the camera, and any face."""
    weights = rng.normal(0.2, 0.3, (len(layout.regions), len(layout.expressions)))
    return TrackState(
        R_cam_head=FRONTAL @ rotation_from_vector(rng.uniform(-0.5, 0.5, 3)),
        t_cam_head=rng.normal((30, -20, 700), 20),
        weights=weights + (1 - weights.sum(axis=1, keepdims=True)) / weights.shape[1],
        units=rng.uniform(0, 1, len(layout.units)),
        gaze=rng.uniform(-0.4, 0.4, 2),
    )


def frame_of(
    number: int,
    time: float,
    state: TrackState | None,
    rng: np.random.Generator,
    *,
    status: Status = "ok",
    layout: Layout = LAYOUT,
) -> TrackedFrame:
    """A frame in this state, lost without one."""
    return TrackedFrame(
        frame=number,
        time=time,
        status=status if state else "lost",
        state=state,
        rms=float(rng.uniform(3, 9)) if state else np.nan,
        seen=float(rng.uniform(0.5, 1)) if state else np.nan,
        deviations=rng.uniform(0, 0.2, len(layout.channels)) * (1.0 if state else np.nan),
        gain=rng.uniform(0.7, 1.3, 3) * (1.0 if state else np.nan),
        bias=rng.normal(0, 10, 3) * (1.0 if state else np.nan),
    )


def track_of(
    states: Sequence[TrackState | None],
    rng: np.random.Generator,
    *,
    times: Sequence[float] | None = None,
    layout: Layout = LAYOUT,
) -> Track:
    """These states at 25 frames/s from 2 s on, or at these times; found anew after a loss."""
    if times is None:
        times = [2 + number / 25 for number in range(len(states))]
    frames = [
        frame_of(number, time, state, rng, layout=layout, status=_status(states, number))
        for number, (time, state) in enumerate(zip(times, states, strict=True))
    ]
    return Track(layout, 640, 360, 812.5, 25.0, tuple(frames))


def _status(states: Sequence[TrackState | None], number: int) -> Status:
    return "reacquired" if number and states[number - 1] is None else "ok"


def random_track(rng: np.random.Generator, *, layout: Layout = LAYOUT) -> Track:
    """Nine frames, of which the fourth and fifth are lost."""
    states = [None if n in (3, 4) else random_state(rng, layout) for n in range(9)]
    return track_of(states, rng, layout=layout)
