"""A known head found in one photo: where it is, and what its face does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.app.ready_head import ReadyHead
from mien.arrays import Array, Float
from mien.camera import Camera
from mien.capture.detector import LandmarkDetector
from mien.capture.photos import Photo, shrunk
from mien.errors import EstimationError
from mien.expressions.rig import Rig
from mien.model.head import Head
from mien.synthesis.head_points import feature_points_on
from mien.track.lens import expected_focal
from mien.track.state import TrackState
from mien.track.tracker import TrackOptions

__all__ = ["HeadInPhoto", "find_head"]

_SIDE = 1280
"""px: in larger photos nothing more is found."""
_STRANGE = 20.0
"""Grey levels by which a fitted head is off: five people's own frames are off by 2 to 13, those of
another one by 15 to 63, where they can be fitted at all."""


@dataclass(frozen=True)
class HeadInPhoto:
    """A head and its face in a photo.

    Attributes:
        points: (n, 3) mm, head space, the feature points of the face.
        camera: of the photo, in its own pixels.
        rig: of the head.
        notes: what the user should know.
    """

    points: Float[Array, "n 3"]
    camera: Camera
    rig: Rig
    notes: tuple[str, ...] = ()


def find_head(head: Head, photo: Photo) -> HeadInPhoto:
    """The largest face of a photo, as the head makes it; some seconds.

    It is fitted to the photo's pixels, as in the frames of a video. Where it does not look like
    them then, head and face are taken from the landmarks alone.

    Raises: EstimationError: no face, one too small, none that the head fits. InputError: as `Rig`.
    """
    width, height = photo.size
    focal = photo.focal_prior_px or expected_focal(head, width, height).focal_px
    pixels = np.ascontiguousarray(shrunk(photo.pixels, _SIDE))
    notes: tuple[str, ...] = ()
    with LandmarkDetector() as detector:
        detector.detect(photo)  # Says what is wrong before the head is made ready.
        ready = ReadyHead(head, detector, TrackOptions())
        tracked = ready.tracker(width, height, focal).step(pixels, 0, 0.0)
        state: TrackState | None = tracked.state
        if state is None or tracked.rms > _STRANGE:
            reduced = pixels.shape[1] / width
            state = ready.starter.find(pixels, focal_px=focal * reduced)
            notes = (
                f"{photo.name}: the face does not look like the head's: another person's, or in "
                "other light; its points come from landmarks alone",
            )
    if state is None:
        raise EstimationError(f"{photo.name}: no face found that fits the head")
    face = ready.model.rig.evaluate(state.face(ready.model.layout))
    camera = Camera(width, height, focal, state.R_cam_head, state.t_cam_head)
    return HeadInPhoto(feature_points_on(face.vertices), camera, ready.model.rig, notes)
