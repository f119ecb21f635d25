from __future__ import annotations

import pytest

import mien.pipelines.tracking.ready_head
import patterned
from marked import Blind
from mien.errors import InputError
from mien.pipelines.tracking.ready_head import ReadyHead
from mien.track.tracker import TrackOptions


def test_lens_and_tracker_share_what_is_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def counted(name: str) -> None:
        kind = getattr(mien.pipelines.tracking.ready_head, name)

        def make(*arguments: object, **options: object) -> object:
            made.append(name)
            return kind(*arguments, **options)

        for module in ("mien.pipelines.tracking.ready_head", "mien.track.tracker"):
            monkeypatch.setattr(f"{module}.{name}", make)

    for name in ("FaceModel", "HeadDetector"):
        counted(name)
    ready = ReadyHead(patterned.head(), Blind(), TrackOptions(units=("jawOpen",)))
    assert made == [], "nothing before it is used"
    head_detector = ready.head_detector
    tracker = ready.tracker(64, 48, 100.0)
    assert made == ["FaceModel", "HeadDetector"]
    assert tracker.layout is head_detector.layout
    assert tracker.layout.units == ("jawOpen",)


def test_a_unit_that_the_head_lacks() -> None:
    ready = ReadyHead(patterned.head(), Blind(), TrackOptions(units=("wink",)))
    with pytest.raises(InputError, match="wink"):
        _ = ready.head_detector
