from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.track_errors import shape_errors, weight_errors

from mien.arrays import Array
from mien.rig.rig import Rig
from mien.track.state import Layout, Track, TrackedFrame, TrackState
from posable import GENERIC, head

LAYOUT = Layout(("mouth", "eyes"), ("neutral", "joy"))
PLACE = np.array([10.0, 0.0, 600.0])
FACING = np.diag([1.0, -1.0, -1.0])


def state(weights: Array) -> TrackState:
    return TrackState(FACING, PLACE, weights, np.zeros(0), np.zeros(2))


def track(*states: TrackState | None, layout: Layout = LAYOUT) -> Track:
    frames = tuple(
        TrackedFrame(
            number,
            number / 25,
            "lost" if item is None else "ok",
            item,
            float("nan"),
            1.0,
            np.zeros(len(layout.channels)),
            np.ones(3),
            np.zeros(3),
        )
        for number, item in enumerate(states)
    )
    return Track(layout, 300, 300, 600.0, 25.0, frames)


REST = np.array([[1.0, 0.0], [1.0, 0.0]])


def test_weights_are_compared_by_name() -> None:
    found_layout = Layout(("eyes", "mouth", "forehead"), ("neutral", "anger", "joy"))
    rows = np.array([[1.0, 0.0, 0.0], [0.2, 0.3, 0.5], [0.0, 1.0, 0.0]])
    found = track(state(rows), layout=found_layout)
    true = track(state(np.array([[0.5, 0.5], [0.8, 0.2]])))
    expected = [[(0.3 + 0.3) / 3, (0.2 + 0.2) / 3]]
    np.testing.assert_allclose(weight_errors(found, true), expected, atol=1e-12)


def test_a_lost_frame_has_no_errors() -> None:
    found, true = track(None, state(REST)), track(state(REST), state(REST))
    assert np.isnan(weight_errors(found, true)[0]).all()
    assert (weight_errors(found, true)[1] == 0).all()


def test_frames_are_paired_by_number() -> None:
    true = track(state(REST), state(np.array([[0.0, 1.0], [1.0, 0.0]])))
    errors = weight_errors(replace(true, frames=true.frames[1:]), true)
    assert np.isnan(errors[0]).all()
    assert (errors[1] == 0).all()


def test_shapes_that_are_alike_have_no_error() -> None:
    rig = Rig(head())
    mask = GENERIC.regions["mouth"]
    smiling = state(np.array([[0.0, 1.0], [1.0, 0.0]]))
    true, found = track(state(REST), smiling), track(state(REST), state(REST))
    errors = shape_errors(found, true, (rig, rig), mask)
    assert errors[0] == 0
    assert 1 < errors[1] < 20
