"""Smoother tracks: over a whole one without lag, or live with a lag that is known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float, check_positive
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.track.state import Track, TrackedFrame, TrackState

_REACH = 3.0
"""Standard deviations on each side of a frame that its window has."""
_EDGE = 1e-6
"""Seconds more, so that a frame at the very edge counts on both sides or on none."""


def smooth_track(track: Track, seconds: float) -> Track:
    """The track with states smoothed over time, without lag.

    Each number becomes that of the straight line that fits it best around the frame, by a symmetric
    Gaussian window over the frames' times: steady motion stays as it is, at the ends and at a
    varying rate, too. Rotations are smoothed about the frame's own, weights keep their sum. What
    lies beyond a lost frame or where the face was found anew has no say. Everything but the states
    stays as it was measured.

    Args:
        track: lost frames may be among its frames.
        seconds: standard deviation of the window; noise of independent frames falls to about 0.53 /
            sqrt(seconds * fps) of it.

    Raises:
        InputError: 0 s or less.
    """
    check_positive("seconds", seconds)
    reach = _REACH * seconds + _EDGE
    frames = list(track.frames)
    for run in _runs(track.frames):
        states = [state for frame in track.frames[run] if (state := frame.state) is not None]
        times = np.array([frame.time for frame in track.frames[run]])
        for index, time in enumerate(times):
            window = slice(*np.searchsorted(times, [time - reach, time + reach]))
            shares = _line_shares((times[window] - time) / seconds)
            calm = _mixture(states[index], states[window], shares)
            frames[run.start + index] = replace(frames[run.start + index], state=calm)
    return replace(track, frames=tuple(frames))


class LiveFilter:
    """Smooths frames as they come: a first-order low pass, whatever the frame rate.

    Its response to a motion that is straight between frames is exact, so that steady motion comes
    `lag` late, neither more nor less.

    Attributes:
        lag: seconds.

    Raises:
        InputError: 0 s or less.
    """

    def __init__(self, lag: float) -> None:
        self.lag = check_positive("lag", lag)
        self._seen: tuple[float, TrackState] | None = None
        self._shown: TrackState | None = None

    def step(self, frame: TrackedFrame) -> TrackedFrame:
        """The frame with its state smoothed. It starts anew where the face was lost or found."""
        if frame.state is None or frame.status != "ok":
            self._seen = None
        if frame.state is None:
            return frame
        shown = frame.state
        if self._seen is not None and self._shown is not None:
            before, last = self._seen
            shares = _low_pass_shares((frame.time - before) / self.lag)
            shown = _mixture(frame.state, (self._shown, last, frame.state), shares)
        self._seen, self._shown = (frame.time, frame.state), shown
        return replace(frame, state=shown)


def _runs(frames: Sequence[TrackedFrame]) -> Iterator[slice]:
    """Stretches of frames that were followed without a break."""
    start = 0
    for index, frame in enumerate((*frames, None)):
        if frame is None or frame.status != "ok":
            if index > start:
                yield slice(start, index)
            lost = frame is not None and frame.state is None
            start = index + 1 if lost else index


def _line_shares(u: Float[Array, " n"]) -> Float[Array, " n"]:
    """What each value counts in the best line's value at 0; sums to 1.

    Args:
        u: (N,) times in standard deviations of the window, 0 among them.

    Source:
        local linear regression: the weighted normal equations of a straight line.
    """
    weights = np.exp(-0.5 * u * u)
    s0, s1, s2 = (float((weights * u**power).sum()) for power in range(3))
    if s0 * s2 - s1 * s1 < 1e-12:  # all at one time
        return weights / s0
    return weights * (s2 - s1 * u) / (s0 * s2 - s1 * s1)


def _low_pass_shares(step: float) -> Float[Array, " 3"]:
    """What the last result, the last value and the new value count; sums to 1, none below 0.

    Args:
        step: time between the two values, in time constants.

    Source:
        y' = (x - y) / lag, integrated over an x that goes straight from value to value.
    """
    if step <= 0:
        return np.array([1.0, 0.0, 0.0])
    decay = np.exp(-step)
    mean = -np.expm1(-step) / step  # of the decay over the step
    return np.array([decay, mean - decay, 1 - mean])


def _mixture(
    middle: TrackState, states: Sequence[TrackState], shares: Float[Array, " n"]
) -> TrackState:
    """The states mixed by shares that sum to 1; rotations in the tangent space at `middle`'s."""
    stacked = np.array([state.R_cam_head for state in states])
    turns = rotation_to_vector(stacked @ middle.R_cam_head.T)
    return TrackState(
        R_cam_head=rotation_from_vector(shares @ turns) @ middle.R_cam_head,
        t_cam_head=shares @ np.array([state.t_cam_head for state in states]),
        weights=np.tensordot(shares, np.array([state.weights for state in states]), axes=1),
        units=shares @ np.array([state.units for state in states]),
        gaze=shares @ np.array([state.gaze for state in states]),
    )
