"""The crop of a video's frames that contains the tracked head."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Int, UInt8
from mien.camera import Camera
from mien.head import Head
from mien.track.state import Track, TrackState

_MARGIN = 0.1
"""Around the bounds of the head in all frames, as a share of its size."""


@dataclass(frozen=True)
class Window:
    """A crop of a video's frames and its scale.

    Attributes:
        left: px of the video.
        top: px of the video.
        right: px of the video.
        bottom: px of the video.
        factor: px shown per px of the video.
    """

    left: int
    top: int
    right: int
    bottom: int
    factor: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as shown, px; even, as video codecs need."""
        sides = (self.right - self.left, self.bottom - self.top)
        width, height = (max(2, 2 * round(side * self.factor / 2)) for side in sides)
        return width, height

    def camera(self, track: Track, state: TrackState) -> Camera:
        """The camera of the window.

        Args:
            track: of the video.
            state: of the frame.
        """
        whole = track.camera(state).resized(self.factor)
        width, height = self.size
        corner = self.factor * np.array([self.left, self.top])
        return replace(whole, width=width, height=height, principal_px=whole.principal - corner)

    def crop(self, pixels: UInt8[Array, "h w 3"], track: Track) -> UInt8[Array, "h w 3"]:
        """The window's part of a frame.

        Args:
            pixels: (h, w, 3) sRGB, as large as the video's or reduced.
            track: of the video.
        """
        import cv2

        scale = pixels.shape[1] / track.width
        top, bottom, left, right = (
            round(side * scale) for side in (self.top, self.bottom, self.left, self.right)
        )
        part = pixels[top:bottom, left:right]
        smaller = self.size[0] < part.shape[1]
        kind = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        return cv2.resize(part, self.size, interpolation=kind)


def crop_window(track: Track, head: Head, limits: tuple[int, int]) -> Window:
    """The whole frame if it fits; otherwise the bounds of the head in all frames.

    Args:
        track: of the video.
        head: that was tracked.
        limits: maximal width and height, px.
    """
    whole = np.array([[0, 0], [track.width, track.height]])
    box = whole if (whole[1] <= limits).all() else _head_bounds(track, head, whole)
    factor = float(min(1.0, (limits / (box[1] - box[0])).min()))
    (left, top), (right, bottom) = box.tolist()
    return Window(left, top, right, bottom, factor)


def _head_bounds(track: Track, head: Head, whole: Int[Array, "2 2"]) -> Int[Array, "2 2"]:
    """Corners of the box around the head in all frames; the whole where it is in none."""
    low, high = head.mesh.vertices.min(axis=0), head.mesh.vertices.max(axis=0)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    cameras = [track.camera(frame.state) for frame in track.frames if frame.state is not None]
    projections = [
        item.project(corners) for item in cameras if (item.to_camera(corners)[:, 2] > 1).all()
    ]
    if not projections:
        return whole
    points = np.concatenate(projections)
    margin = _MARGIN * np.median([np.ptp(item, axis=0).max() for item in projections])
    box = np.rint([points.min(axis=0) - margin, points.max(axis=0) + margin]).astype(np.int64)
    box = np.clip(box, 0, whole[1])
    return box if (box[1] > box[0]).all() else whole
