"""A head made ready for tracking: what its lens and its tracker share is prepared once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mien.capture.faces.detector import LandmarkDetector
from mien.head import Head
from mien.track.face_model import FaceModel
from mien.track.landmarks.initialization import HeadDetector
from mien.track.tracker import Tracker, TrackOptions


@dataclass(frozen=True)
class ReadyHead:
    """A head, how it is tracked, and what that needs; it takes some seconds when first used."""

    head: Head
    detector: LandmarkDetector
    options: TrackOptions

    @cached_property
    def model(self) -> FaceModel:
        """What is compared with pictures. Raises: InputError: as FaceModel."""
        return FaceModel(self.head, units=self.options.units)

    @cached_property
    def head_detector(self) -> HeadDetector:
        """What finds it in them."""
        return HeadDetector(self.head, self.model.layout, self.detector, rig=self.model.rig)

    def tracker(self, width: int, height: int, focal_px: float) -> Tracker:
        """Before the first of pictures of this size, upright, px."""
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
