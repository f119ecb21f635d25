"""Examples of real people."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mien.assets.feature_points import load_feature_layout
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.video import Video
from mien.pipelines.examples import gather_examples
from mien.synthesis.examples.example_plan import lip_gaps
from mien.synthesis.examples.mouth_occlusion import LipContrast


def test_a_smile_and_a_face_at_rest(shared: Path) -> None:
    """Three seconds of somebody who smiles, once with closed eyes."""
    found = gather_examples(shared / "data" / "videos" / "single_face.mp4").examples
    gaps = lip_gaps(found.layout, found.geometries) / np.ptp(found.neutral.points[:, 0])
    assert gaps[0] < 0.01
    assert gaps[found.standard] == gaps.max() > 0.1
    assert 15 < len(found.examples) <= 40
    assert 60 < len(found.statistics) <= 72
    lids = [found.layout.index(f"right_{which}_eyelid.1") for which in ("upper", "lower")]
    eyes = np.linalg.norm(np.diff(found.geometries[:, lids], axis=1)[:, 0], axis=1)
    assert eyes.min() < 0.5 * eyes[0]


def test_a_hand_before_the_mouth(shared: Path) -> None:
    """A clip in which one is there from frame 60 to 222, and not before 50 nor after 240."""
    video = Video(shared / "data" / "videos" / "WolfgangLanger_Pexels.mp4")
    lips, index = LipContrast(load_feature_layout()), []
    with LandmarkDetector() as detector:
        for frame in video.frames():
            if frame.index % 6:
                continue
            pixels = frame.pixels()
            face = detector.detect_fast(pixels)
            assert face is not None
            lips(pixels, face.points[:, :2])
            index.append(frame.index)
    numbers, occluded = np.array(index), lips.occluded()
    hand = (numbers >= 60) & (numbers <= 222)
    assert occluded[hand].mean() > 0.5
    assert not occluded[(numbers < 50) | (numbers > 240)].any()
    assert lips.occluded(numbers / 24)[hand].all()
