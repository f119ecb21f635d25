from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import mien.pipelines.tracking.prepared_head
import patterned
from filmed import written
from marked import Blind
from mien.arrays import Array
from mien.capture.video.video import Video
from mien.errors import InputError
from mien.pipelines.tracking.prepared_head import FINDING_FOCAL, PreparedHead, find_focal
from mien.track.landmarks.focal import FocalEstimate
from mien.track.tracker import TrackOptions
from posable import head


def test_model_and_head_detector_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def counted(name: str) -> None:
        kind = getattr(mien.pipelines.tracking.prepared_head, name)

        def make(*arguments: object, **options: object) -> object:
            made.append(name)
            return kind(*arguments, **options)

        for module in ("mien.pipelines.tracking.prepared_head", "mien.track.tracker"):
            monkeypatch.setattr(f"{module}.{name}", make)

    for name in ("FaceModel", "HeadDetector"):
        counted(name)
    prepared = PreparedHead(patterned.head(), Blind(), TrackOptions(units=("jawOpen",)))
    assert made == [], "nothing before it is used"
    head_detector = prepared.head_detector
    tracker = prepared.tracker(64, 48, 100.0)
    assert made == ["FaceModel", "HeadDetector"]
    assert tracker.layout is head_detector.layout
    assert tracker.layout.units == ("jawOpen",)


def test_a_unit_that_the_head_lacks() -> None:
    prepared = PreparedHead(patterned.head(), Blind(), TrackOptions(units=("wink",)))
    with pytest.raises(InputError, match="wink"):
        _ = prepared.head_detector


def test_focal_length_is_estimated_from_every_fifth_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Array] = []
    tracker = SimpleNamespace(resembles=lambda pixels, found: True)

    def estimate(frames: object, *rest: object, is_match: object) -> FocalEstimate:
        assert is_match is tracker.resembles
        seen.extend(frames)
        return FocalEstimate(400.0, 0.1, 2, "a note")

    monkeypatch.setattr(mien.pipelines.tracking.prepared_head, "estimate_focal", estimate)
    monkeypatch.setattr(PreparedHead, "head_detector", None)
    monkeypatch.setattr(PreparedHead, "tracker", lambda prepared, *size: tracker)
    monkeypatch.setattr(mien.pipelines.tracking.prepared_head, "_SIDE", 32)
    levels = range(20, 140, 10)
    frames = (np.full((48, 64, 3), level, np.uint8) for level in levels)
    clip = Video(written(tmp_path / "a.mp4", frames))
    told: list[tuple[str, int, int]] = []
    prepared = PreparedHead(head(), None, TrackOptions())
    focal_px, note = find_focal(clip, clip.info(), prepared, lambda *step: told.append(step))
    assert (focal_px, note) == (800.0, "a note"), "of the pictures at their full size"
    assert [picture.mean() for picture in seen] == pytest.approx([20, 70, 120], abs=3)
    assert {picture.shape for picture in seen} == {(24, 32, 3)}
    assert told == [
        (FINDING_FOCAL, 0, 12),
        (FINDING_FOCAL, 5, 12),
        (FINDING_FOCAL, 10, 12),
        (FINDING_FOCAL, 12, 12),
    ]
