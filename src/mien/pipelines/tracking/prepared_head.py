"""A head prepared for tracking, and the focal length of a video of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.frames_ahead import frames_ahead
from mien.capture.video.video import Video, VideoInfo
from mien.head import Head
from mien.progress import Progress
from mien.track.face_model import FaceModel
from mien.track.landmarks.focal import estimate_focal
from mien.track.landmarks.initialization import HeadDetector
from mien.track.lens import expected_focal
from mien.track.tracker import Tracker, TrackOptions

FINDING_FOCAL = "Finding the focal length"
_FRAMES, _FRAME_STEP, _SIDE = 300, 5, 1280
"""The frames that the focal length is estimated from, and their longer side, px: in larger ones the
detector finds landmarks no better."""


@dataclass(frozen=True)
class PreparedHead:
    """A head with what its trackers share: each part is computed once, in seconds, when first used.

    Attributes:
        head: that is tracked.
        detector: of landmarks.
        options: of the trackers.
    """

    head: Head
    detector: LandmarkDetector
    options: TrackOptions

    @cached_property
    def model(self) -> FaceModel:
        """What is compared with pictures.

        Raises:
            InputError: as FaceModel.
        """
        return FaceModel(self.head, units=self.options.units)

    @cached_property
    def head_detector(self) -> HeadDetector:
        """What finds the head in pictures."""
        return HeadDetector(self.head, self.model.layout, self.detector, rig=self.model.rig)

    def tracker(self, width: int, height: int, focal_px: float) -> Tracker:
        """A new tracker for upright pictures of this size and focal length, px."""
        return Tracker(
            self.head,
            width,
            height,
            focal_px=focal_px,
            detector=self.detector,
            options=self.options,
            model=self.model,
            head_detector=self.head_detector,
        )


def find_focal(
    clip: Video, info: VideoInfo, prepared: PreparedHead, progress: Progress
) -> tuple[float, str]:
    """Focal length of a clip's pictures in px, from the first of them, and a note on it.

    Args:
        clip: of the head.
        info: of the clip.
        prepared: the head.
        progress: called with FINDING_FOCAL, the frames done and their total.
    """
    total = min(info.frames or _FRAMES, _FRAMES)
    progress(FINDING_FOCAL, 0, total)  # At once: preparing the head takes seconds.
    expected = expected_focal(prepared.head, info.width, info.height)
    tracker = prepared.tracker(info.width, info.height, expected.focal_px)
    estimate = estimate_focal(
        _every_fifth_frame(clip, total, progress),
        prepared.head_detector,
        prepared.head,
        is_match=tracker.resembles,
    )
    factor = min(1.0, _SIDE / max(info.width, info.height))
    return estimate.focal_px / factor, estimate.note


def _every_fifth_frame(
    clip: Video, total: int, progress: Progress
) -> Iterator[UInt8[Array, "h w 3"]]:
    with frames_ahead(clip, max_side=_SIDE) as pictures:
        for picture in islice(pictures, 0, _FRAMES, _FRAME_STEP):
            yield picture.pixels
            progress(FINDING_FOCAL, min(picture.frame + _FRAME_STEP, total), total)
