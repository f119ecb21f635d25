from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.report.track.charts import Plot, Row, build_plots
from mien.report.track.figures import row_limits, save_figure, true_runs
from mien.track.series import series_of
from mien.track.state import Layout, Track
from tracks import random_state, random_track, track_of


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    return random_track(rng)


def saved(path: Path, track: Track, name: str = "weights_mouth") -> Array:
    plot = next(plot for plot in build_plots(track, track) if plot.name == name)
    save_figure(path, plot, series_of(track))
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_a_figure_has_its_size_and_colours(tmp_path: Path, track: Track) -> None:
    picture = saved(tmp_path / "a.png", track)
    assert picture.shape[1] == 1300
    for colour in ((0, 114, 178), (217, 217, 217), (213, 94, 0), (26, 26, 26)):
        assert (np.abs(picture.astype(int) - colour).max(axis=2) < 50).sum() > 50, colour


def test_lost_frames_are_shaded(tmp_path: Path, track: Track) -> None:
    shares = []
    for found in (track, replace(track, frames=track.frames[:3])):
        picture = saved(tmp_path / "a.png", found)
        shares.append(float((picture == 217).all(axis=2).mean()))
    assert shares[0] > 0.05
    assert shares[1] < 0.001


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_same_track_gives_the_same_file(tmp_path: Path, track: Track, kind: str) -> None:
    plot, series = build_plots(track)[1], series_of(track)
    for name in ("a", "b"):
        save_figure(tmp_path / f"{name}.{kind}", plot, series)
    first, second = ((tmp_path / f"{name}.{kind}").read_bytes() for name in ("a", "b"))
    assert first == second


@pytest.mark.parametrize("name", ["rms", "weights_mouth", "rotation", "translation"])
def test_a_single_frame_is_a_dot(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    picture = saved(tmp_path / "a.png", track_of([random_state(rng)], rng), name)
    blue = np.abs(picture.astype(int) - (0, 114, 178)).max(axis=2) < 12
    assert blue[80:].any()


def test_a_track_of_which_all_is_lost(tmp_path: Path, rng: np.random.Generator) -> None:
    track = track_of([None, None, None], rng)
    series = series_of(track)
    for plot in build_plots(track, track):
        save_figure(tmp_path / f"{plot.name}.png", plot, series)


def test_limits_contain_all_numbers() -> None:
    rows = (
        Row("a", np.array([0.0, 2, np.nan]), truth=np.array([np.nan, 5, 1])),
        Row("b", np.array([0.2, 0.2, 0.2]), np.full(3, 9.0), limits=(0, 1)),
        Row("c", np.full(3, 7.0)),
        Row("d", np.full(3, np.nan)),
    )
    found = row_limits(Plot("p", "", "", rows))
    np.testing.assert_allclose(found, [[-0.3, 5.3], [-0.06, 1.06], [6.5, 7.5], [-0.06, 1.06]])
    (shared_scale,) = set(row_limits(Plot("p", "", "", rows[:3], shared_scale=True)))
    np.testing.assert_allclose(shared_scale, [-0.42, 7.42])


@pytest.mark.parametrize(
    ("mask", "runs"),
    [("", []), ("0", []), ("1", [(0, 1)]), ("0110100", [(1, 3), (4, 5)]), ("11", [(0, 2)])],
)
def test_runs_of_a_mask(mask: str, runs: list[tuple[int, int]]) -> None:
    assert list(true_runs(np.array([digit == "1" for digit in mask], bool))) == runs


def test_expressions_of_any_name(tmp_path: Path, rng: np.random.Generator) -> None:
    layout = Layout(("mouth",), ("neutral", "$joy_", "\u559c\u3073"))
    saved(tmp_path / "a.png", random_track(rng, layout=layout))
