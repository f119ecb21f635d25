from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import mien.pipelines.track_lens
from filmed import written
from mien.arrays import Array
from mien.capture.video.video import Video
from mien.pipelines.track_lens import LENS, find_focal
from mien.pipelines.tracking.ready_head import ReadyHead
from mien.track.landmarks.focal import FocalEstimate
from mien.track.tracker import TrackOptions
from posable import head


def test_every_fifth_of_the_first_frames_is_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Array] = []
    tracker = SimpleNamespace(resembles=lambda pixels, found: True)

    def estimate(frames: object, *rest: object, is_match: object) -> FocalEstimate:
        assert is_match is tracker.resembles
        seen.extend(frames)
        return FocalEstimate(400.0, 0.1, 2, "a note")

    monkeypatch.setattr(mien.pipelines.track_lens, "estimate_focal", estimate)
    monkeypatch.setattr(ReadyHead, "head_detector", None)
    monkeypatch.setattr(ReadyHead, "tracker", lambda ready, *size: tracker)
    monkeypatch.setattr(mien.pipelines.track_lens, "_SIDE", 32)
    levels = range(20, 140, 10)
    frames = (np.full((48, 64, 3), level, np.uint8) for level in levels)
    clip = Video(written(tmp_path / "a.mp4", frames))
    told: list[tuple[str, int, int]] = []
    ready = ReadyHead(head(), None, TrackOptions())
    focal_px, note = find_focal(clip, clip.info(), ready, lambda *step: told.append(step))
    assert (focal_px, note) == (800.0, "a note"), "of the pictures at their full size"
    assert [picture.mean() for picture in seen] == pytest.approx([20, 70, 120], abs=3)
    assert {picture.shape for picture in seen} == {(24, 32, 3)}
    assert told == [(LENS, 0, 12), (LENS, 5, 12), (LENS, 10, 12), (LENS, 12, 12)]
