"""A live run that is kept: what the tracker is shown before it counts, and what is written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import mien.pipelines.live
from filmed import grey, written
from mien.arrays import Array
from mien.errors import InputError
from mien.io.tracks.track_csv import load_track
from mien.pipelines.live import track_live_video, warm_up
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.render.picture import HeadRenderer
from mien.track.lens import expected_focal
from mien.track.smoothing import LiveFilter
from mien.track.state import TrackedFrame
from posable import head
from tracks import LAYOUT, frame_of, random_state

COUNT = 4


class Spy:
    """Finds a random head in any picture, another with every step."""

    layout = LAYOUT
    other_faces_seen = False

    def __init__(self) -> None:
        self.asked: list[tuple[int, int, float]] = []
        self.shown: list[tuple[int, int]] = []
        self.found: list[TrackedFrame] = []

    def tracker(self, width: int, height: int, focal_px: float) -> Spy:
        self.asked.append((width, height, focal_px))
        return self

    def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
        rng = np.random.default_rng(len(self.found))
        self.shown.append((pixels.shape[1], pixels.shape[0]))
        self.found.append(frame_of(frame, time, random_state(rng), rng))
        return self.found[-1]

    def resume(self, frames: Sequence[TrackedFrame]) -> None:
        self.found = list(frames)


class Nobody:
    """In the place of the detector."""

    closed = 0

    def __enter__(self) -> None:
        return None

    def __exit__(self, *error: object) -> None:
        type(self).closed += 1


@pytest.fixture
def spy(monkeypatch: pytest.MonkeyPatch) -> Spy:
    """In the place of the tracker; warming it up takes no time."""
    one = Spy()
    monkeypatch.setattr(PreparedHead, "tracker", lambda prepared, *size: one.tracker(*size))
    monkeypatch.setattr(mien.pipelines.live, "HeadRenderer", lambda *rest, **more: None)
    monkeypatch.setattr(mien.pipelines.live, "warm_up", lambda *rest: None)
    monkeypatch.setattr(mien.pipelines.live, "LandmarkDetector", Nobody)
    monkeypatch.setattr(Nobody, "closed", 0)
    monkeypatch.setattr(PreparedHead, "model", type("Model", (), {"rig": None}))
    return one


@pytest.fixture
def clip(tmp_path: Path) -> str:
    return str(written(tmp_path / "a.mp4", grey(range(40, 40 + 20 * COUNT, 20))))


def test_what_was_tracked_is_written(clip: str, spy: Spy, tmp_path: Path) -> None:
    files = TrackFiles(tmp_path / "t.csv", openface=tmp_path / "o.csv")
    summary = track_live_video(clip, head(), files)
    assert summary.frames == COUNT
    assert Nobody.closed == 1
    found = load_track(files.table)
    assert found.layout == LAYOUT
    assert (found.width, found.height, found.fps) == (64, 48, 10)
    assert [frame.frame for frame in found.frames] == list(range(COUNT))
    for frame, given in zip(found.frames, spy.found, strict=True):
        assert frame.state is not None
        assert given.state is not None
        np.testing.assert_allclose(frame.state.values, given.state.values, atol=1e-9)
    assert len((tmp_path / "o.csv").read_text().splitlines()) == 1 + COUNT


def test_focal_length_is_expected_or_given(clip: str, spy: Spy) -> None:
    track_live_video(clip, head())
    track_live_video(clip, head(), lens="100px")
    usual = expected_focal(head(), 64, 48).focal_px
    assert spy.asked == [(64, 48, pytest.approx(usual)), (64, 48, 100.0)]


def test_smoothed_with_a_known_lag(clip: str, spy: Spy, tmp_path: Path) -> None:
    track_live_video(clip, head(), TrackFiles(tmp_path / "t.csv"), lag=0.2)
    calm = LiveFilter(0.2)
    for frame, given in zip(load_track(tmp_path / "t.csv").frames, spy.found, strict=True):
        state = calm.step(given).state
        assert frame.state is not None
        assert state is not None
        np.testing.assert_allclose(frame.state.t_cam_head, state.t_cam_head, atol=1e-9)


def test_bad_arguments_are_refused_before_tracking(clip: str, spy: Spy, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected another name than that of the video"):
        track_live_video(clip, head(), TrackFiles(tmp_path / "t.csv", openface=Path(clip)))
    with pytest.raises(InputError, match="expected a name that ends in"):
        track_live_video(clip, head(), TrackFiles(tmp_path / "t.txt"))
    with pytest.raises(InputError, match="lag: expected a number above zero"):
        track_live_video(clip, head(), lag=0)
    with pytest.raises(InputError, match="--stream: expected livelink://"):
        track_live_video(clip, head(), None, ["a:1"])
    with pytest.raises(InputError, match="lens: expected a number with its unit"):
        track_live_video(clip, head(), lens="wide")
    assert (spy.asked, spy.shown) == ([], [])


@pytest.mark.parametrize(
    ("size", "shown"), [((64, 48), (64, 48)), ((1920, 1080), (480, 270)), ((720, 1280), (270, 480))]
)
def test_warm_up_tracks_two_pictures_and_resets(
    size: tuple[int, int], shown: tuple[int, int]
) -> None:
    tracker = Spy()
    warm_up(tracker, HeadRenderer(head()), size)
    assert tracker.shown == [shown, shown]
    assert tracker.found == []
