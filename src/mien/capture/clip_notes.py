"""What is odd about the faces of a clip, gathered over its frames and said once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.capture.detector import LandmarkDetector
from mien.capture.landmarks import is_cut
from mien.capture.mediapipe_face import DetectedFace
from mien.capture.photos import Photo, shrunk
from mien.errors import EstimationError

_CLOSELY = frozenset({0, 6, 18, 42, 90})
"""Which of the frames are looked at closely enough to tell how they stand."""
_SIDE = 640
_STANDING = {
    1: "the face lies on its side in the clip: turn it by 90 degrees counterclockwise",
    2: "the face stands on its head in the clip: turn it by 180 degrees",
    3: "the face lies on its side in the clip: turn it by 90 degrees clockwise",
}


def quarters_to_upright(R_cam_head: Float[Array, "3 3"]) -> int:
    """By how many quarters, counterclockwise, a picture has to be turned for its face to stand."""
    x, y = -R_cam_head[0, 1], -R_cam_head[1, 1]
    return round(float(np.arctan2(-x, y)) / (np.pi / 2)) % 4


class ClipNotes:
    """Counts frames with several faces and with faces that the edge cuts, and finds out whether
    the clip stands upright."""

    def __init__(self, detector: LandmarkDetector) -> None:
        self._detector = detector
        self._frames = self._several = self._cut = 0
        self._standing: Counter[int] = Counter()

    def look(self, pixels: UInt8[Array, "h w 3"], faces: Sequence[DetectedFace]) -> None:
        """Take in a frame and its faces, px of the frame, the one that is used first."""
        size = (pixels.shape[1], pixels.shape[0])
        if self._frames in _CLOSELY:
            self._look_closely(pixels)
        self._frames += 1
        self._several += len(faces) > 1
        self._cut += bool(faces) and is_cut(faces[0].points[:, :2], size)

    @property
    def notes(self) -> list[str]:
        """One of each kind."""
        notes = []
        if self._several:
            frames = f"{self._several} of {self._frames} frames"
            notes.append(f"several faces in {frames}: the largest of each is used")
        if self._cut:
            notes.append(f"the edge cuts the face in {self._cut} of {self._frames} frames")
        return notes + self.standing

    @property
    def standing(self) -> list[str]:
        """A note where the clip does not stand upright."""
        quarters, count = (self._standing.most_common(1) or [(0, 0)])[0]
        is_odd = quarters and count > self._standing.total() / 2
        return [_STANDING[quarters]] if is_odd else []

    def _look_closely(self, pixels: UInt8[Array, "h w 3"]) -> None:
        small = np.ascontiguousarray(shrunk(pixels, _SIDE))
        try:
            found = self._detector.detect(Photo("frame", Path("frame"), small))
        except EstimationError:
            return
        self._standing[quarters_to_upright(found.R_cam_head)] += 1
