from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.report.track.charts import Plot, build_plots
from mien.track.state import Layout, Track
from tracks import LAYOUT, random_state, random_track, track_of


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    return random_track(rng)


def by_name(plots: list[Plot]) -> dict[str, Plot]:
    return {plot.name: plot for plot in plots}


def labels(plot: Plot) -> list[str]:
    return [row.label for row in plot.rows]


def test_names_and_labels_of_all_plots(track: Track) -> None:
    plots = by_name(build_plots(track))
    assert list(plots) == [
        *("rms", "weights_mouth", "weights_eyes", "units"),
        *("eyes", "rotation", "quaternion", "translation"),
    ]
    for region in LAYOUT.regions:
        assert labels(plots[f"weights_{region}"]) == list(LAYOUT.expressions)
    assert labels(plots["units"]) == ["jawOpen"], "blinks are with the eyes"
    assert labels(plots["eyes"]) == ["gaze to the left, °", "gaze up, °", "eyeBlinkLeft"]
    assert labels(plots["rotation"]) == ["yaw, °", "pitch, °", "roll, °"]
    assert all(row.truth is None for plot in plots.values() for row in plot.rows)


def test_values_are_the_tracks(track: Track) -> None:
    plots = by_name(build_plots(track))
    found = track.frames[6]
    assert found.state is not None
    joy = plots["weights_eyes"].rows[1]
    assert joy.deviations is not None
    assert joy.values[6] == found.state.weights[1, 1]
    assert joy.deviations[6] == found.deviations[LAYOUT.channels.index("eyes.joy")]
    gaze = plots["eyes"].rows[1]
    assert gaze.values[6] == pytest.approx(np.degrees(found.state.gaze[1]))
    assert plots["rms"].rows[1].values[6] == pytest.approx(100 * found.seen)


def test_truth_brings_errors(track: Track) -> None:
    plots = by_name(build_plots(track, track))
    for name in ("rotation", "translation"):
        assert labels(plots[name])[-1].startswith("error")
        errors = plots[name].rows[-1].values
        np.testing.assert_allclose(errors[np.isfinite(errors)], 0, atol=1e-5)
    for name in ("weights_mouth", "units", "eyes", "rotation", "quaternion", "translation"):
        for row in plots[name].rows:
            if not row.label.startswith("error"):
                np.testing.assert_array_equal(row.truth, row.values)


def test_channels_that_the_reference_lacks_have_no_truth(
    track: Track, rng: np.random.Generator
) -> None:
    """As where fewer expressions were used than the model has."""
    layout = Layout(("mouth",), ("neutral", "joy"))
    states = [random_state(rng, layout) for _ in track.frames]
    plots = by_name(build_plots(track, track_of(states, rng, layout=layout)))
    told = {row.label: row.truth is not None for row in plots["weights_mouth"].rows}
    assert told == {"neutral": True, "joy": True, "anger": False}
    assert all(row.truth is None for row in plots["weights_eyes"].rows)


def test_a_head_of_neutral_alone_has_no_weights(rng: np.random.Generator) -> None:
    layout = Layout(("mouth",), ("neutral",))
    plots = by_name(build_plots(random_track(rng, layout=layout)))
    assert not any(name.startswith(("weights", "units")) for name in plots)
    assert "eyes" in plots


def test_only_the_units_that_move_most_are_plotted(rng: np.random.Generator) -> None:
    names = tuple(f"unit{index}" for index in range(20))
    layout = Layout((), ("neutral",), names)
    size = np.arange(20) % 5
    states = [
        replace(random_state(rng, layout), units=factor * size) for factor in (0.0, 0.05, 0.1)
    ]
    plot = by_name(build_plots(track_of(states, rng, layout=layout)))["units"]
    assert labels(plot) == [name for index, name in enumerate(names) if index % 5 > 1]
    assert plot.caption.endswith("The 12 of 20 that move most.")
