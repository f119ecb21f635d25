"""The landmark groups are the detector's own."""

from __future__ import annotations

import pytest

from mien.assets import landmark_sets


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("EYES", ["LEFT_EYE", "RIGHT_EYE"]),
        ("EYEBROWS", ["LEFT_EYEBROW", "RIGHT_EYEBROW"]),
        ("LIPS", ["LIPS"]),
        ("NOSE", ["NOSE"]),
        ("FACE_OVAL", ["FACE_OVAL"]),
    ],
)
def test_groups_are_the_detectors(name: str, parts: list[str]) -> None:
    from mediapipe.tasks.python.vision import FaceLandmarksConnections

    edges = [getattr(FaceLandmarksConnections, f"FACE_LANDMARKS_{part}") for part in parts]
    numbers = {number for group in edges for edge in group for number in (edge.start, edge.end)}
    assert getattr(landmark_sets, name) == numbers
