"""The sample timeline that ships: it suits any head, and lives."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.perform import frame_times, sample_timeline
from mien.animate.timeline import Timeline
from mien.assets.generic import load_generic_head
from mien.io.timeline.timeline_file import check_timeline
from mien.io.timeline.timeline_json import load_timeline_json


@pytest.fixture(scope="module")
def sample() -> Timeline:
    return load_timeline_json(sample_timeline())


def test_it_lasts_ten_seconds_and_uses_everything(sample: Timeline) -> None:
    assert (sample.duration, sample.fps, sample.size) == (10.0, 30.0, (720, 900))
    groups = {channel.split(".")[0] for channel in sample.tracks}
    assert groups == {"head", "gaze", "units"}
    assert {type(layer.generator).__name__ for layer in sample.layers} >= {"Blink", "Breathing"}
    played = [placement.clip for placement in sample.placements]
    assert any(played.count(clip) > 1 for clip in sample.clips), "a clip is used again"


def test_it_needs_nothing_but_units(sample: Timeline) -> None:
    check_timeline(sample, expressions=(), units=load_generic_head().unit_names)


def test_its_values_are_those_of_a_face(sample: Timeline) -> None:
    values = sample.sample(frame_times(sample, 120))
    for channel, row in values.items():
        if channel.startswith("units."):
            assert row.min() >= 0, channel
            assert row.max() <= 1 + 1e-9, channel
        if channel.startswith("gaze."):
            assert np.abs(row).max() < np.radians(20)
    assert np.abs(values["head.yaw"]).max() < np.radians(20)


def test_it_blinks_and_never_stands_still(sample: Timeline) -> None:
    values = sample.sample(frame_times(sample))
    blinks = np.diff((values["units.eyeBlinkLeft"] > 0.5).astype(int)) == 1
    assert 3 <= blinks.sum() <= 6
    yaw = values["head.yaw"] + values["head.pitch"] + values["head.roll"]
    assert np.ptp(np.lib.stride_tricks.sliding_window_view(yaw, 30), axis=1).min() > 1e-3


def test_it_ends_as_it_starts(sample: Timeline) -> None:
    ends = sample.sample(np.array([0.0, 10.0]))
    for channel, (first, last) in ends.items():
        if not channel.startswith("head."):
            assert last == pytest.approx(first, abs=0.02), channel
