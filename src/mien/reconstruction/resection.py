"""Cameras of photos of a head that is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.reconstruction.features import Features

MIN_FEATURES = 4
"""With fewer, several cameras would do."""


def resect_cameras(
    views: Sequence[CapturedView],
    features: Features,
    focal_px: Float[Array, " k"],
    vertices: Float[Array, "v 3"],
) -> tuple[Camera, ...]:
    """Where each photo was taken from, by where it shows the features of a head.

    Args:
        views: K photos.
        features: of the same K photos.
        focal_px: (K,).
        vertices: (V, 3) mm.

    Raises:
        EstimationError: fewer than four features in a photo, or no camera that sees them so.
    """
    places = features.on(vertices)
    return tuple(
        _place(view, places[seen], image[seen], focal)
        for view, seen, image, focal in zip(
            views, features.observed, features.image_points, focal_px.tolist(), strict=True
        )
    )


def _place(
    view: CapturedView, places: Float[Array, "n 3"], image: Float[Array, "n 2"], focal_px: float
) -> Camera:
    import cv2

    if len(places) < MIN_FEATURES:
        raise EstimationError(f"{view.photo.name}: {len(places)} points are too few for a camera")
    width, height = view.photo.size
    centred = image - [width / 2, height / 2]
    lens = np.diag([focal_px, focal_px, 1.0])
    try:
        solved, turn, shift = cv2.solvePnP(places, centred, lens, None, flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error:  # Points that lie in one place.
        solved = False
    if not solved or shift[2, 0] <= 0:
        raise EstimationError(f"{view.photo.name}: no camera sees its points so")
    rotation, _ = cv2.Rodrigues(turn)
    return Camera(width, height, focal_px, rotation, shift.ravel())
