"""A known head found in one photo: its pose and expression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.landmarks import cut_note
from mien.capture.images.photos import Photo, downscale
from mien.errors import EstimationError
from mien.head import Head
from mien.pipelines.tracking.prepared_head import PreparedHead
from mien.rig.rig import Rig
from mien.synthesis.heads.feature_points import feature_points_on
from mien.track.lens import expected_focal
from mien.track.tracker import MISMATCH_RMS, TrackOptions

__all__ = ["UNLIKE", "HeadInPhoto", "find_head"]

UNLIKE = "the face does not look like the head's: another person's, or in other light"

_SIDE = 1280
"""px: in larger photos nothing more is found."""


@dataclass(frozen=True)
class HeadInPhoto:
    """The expression of a head in a photo.

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
    """Pose and expression of a head, fitted to the face in a photo; takes some seconds.

    They are fitted to the photo's pixels, as in the frames of a video. Where the result does not
    look like the photo, they come from the landmarks of the largest face alone.

    Args:
        head: of the person.
        photo: one face in it is the person's.

    Raises:
        EstimationError: no face, one too small, none that the head fits.
        InputError: as `Rig`.
    """
    width, height = photo.size
    focal = photo.focal_prior_px or expected_focal(head, width, height).focal_px
    pixels = np.ascontiguousarray(downscale(photo.pixels, _SIDE))
    with LandmarkDetector() as detector:
        largest = detector.detect(photo)  # Fails before the slow preparation of the head.
        prepared = PreparedHead(head, detector, TrackOptions())
        # The tracker finds upright faces only.
        start = prepared.head_detector.fit(
            largest.as_detected_face(), size=photo.size, focal_px=focal
        )
        tracked = [
            prepared.tracker(width, height, focal).step(pixels, 0, 0.0, initial)
            for initial in (None, start)
        ]
    best = min(tracked, key=lambda frame: np.nan_to_num(frame.rms, nan=np.inf))
    like = best.state is not None and best.rms <= MISMATCH_RMS
    state = best.state if like else start and start.state
    if state is None:
        raise EstimationError(f"{photo.name}: no face found that fits the head")
    face = prepared.model.rig.evaluate(state.face(prepared.model.layout))
    camera = Camera(width, height, focal, state.R_cam_head, state.t_cam_head)
    landmarks = camera.project(load_generic_head().landmark_positions(face.vertices))
    notes = [f"{photo.name}: {note}" for note in cut_note(landmarks, photo.size)]
    if not like:
        notes.append(f"{photo.name}: {UNLIKE}; its points come from landmarks alone")
    return HeadInPhoto(feature_points_on(face.vertices), camera, prepared.model.rig, tuple(notes))
