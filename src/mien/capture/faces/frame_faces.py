"""The faces in the frames of a video, small ones too."""

from __future__ import annotations

from dataclasses import replace

from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector, detect_around
from mien.capture.faces.mediapipe_face import DetectedFace
from mien.capture.images.photos import downscale

_AROUND = 1.5
"""Where a face was is looked for it within so many of its widths to each side."""
_SEARCH_EVERY = 8
"""Of frames in a row without a face, one in so many is searched in full: that takes ten times as
long."""


class FrameFaces:
    """Finds the faces of frames that come one after the other.

    A frame is looked at as a whole, reduced. Where that shows nothing, a face may be small in it:
    it is looked for at full resolution where the last one was, and now and then everywhere.

    Args:
        detector: of a single picture.
        side: px, to whose longer side frames are reduced; None leaves them.
    """

    def __init__(self, detector: LandmarkDetector, side: int | None = None) -> None:
        self._detector, self._side = detector, side
        self._last: DetectedFace | None = None
        self._misses = 0

    def find(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Every face, the largest first, in px of the frame."""
        small = pixels if self._side is None else downscale(pixels, self._side)
        factor = pixels.shape[1] / small.shape[1]
        faces = [
            replace(face, points=factor * face.points)
            for face in self._detector.detect_all_fast(small)
        ]
        if not faces and self._last is not None:
            middle = self._last.points[:, :2].mean(axis=0)
            place = (float(middle[0]), float(middle[1]))
            faces = detect_around(self._detector, pixels, place, _AROUND * self._last.width)
        if not faces:
            if self._misses % _SEARCH_EVERY == 0:
                faces = self._detector.detect_in_tiles(pixels)
            self._misses += 1
        if faces:
            self._last, self._misses = max(faces, key=lambda face: face.width), 0
        return sorted(faces, key=lambda face: -face.width)
