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

MAX_MISFIT = 0.5
"""Of the points' extent in the photo: farther off, they are not seen at all."""


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
    points = features.on(vertices)
    return tuple(
        _resect(view, points[seen], image[seen], focal)
        for view, seen, image, focal in zip(
            views, features.observed, features.image_points, focal_px.tolist(), strict=True
        )
    )


def _resect(
    view: CapturedView, points: Float[Array, "n 3"], image: Float[Array, "n 2"], focal_px: float
) -> Camera:
    import cv2

    if len(points) < MIN_FEATURES:
        raise EstimationError(f"{view.photo.name}: {len(points)} points are too few for a camera")
    width, height = view.photo.size
    centred = image - [width / 2, height / 2]
    intrinsics = np.diag([focal_px, focal_px, 1.0])
    # The first fails before long lenses, which see almost without perspective.
    for method in (cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_ITERATIVE):
        try:
            solved, rotation_vector, translation = cv2.solvePnP(
                points, centred, intrinsics, None, flags=method
            )
        except cv2.error:  # Points that lie in one place.
            continue
        if not solved or translation[2, 0] <= 0:
            continue
        rotation, _ = cv2.Rodrigues(rotation_vector)
        camera = Camera(width, height, focal_px, rotation, translation.ravel())
        off = np.linalg.norm(camera.project(points) - image, axis=1)
        if np.median(off) < MAX_MISFIT * np.linalg.norm(image.std(axis=0)):
            return camera
    raise EstimationError(f"{view.photo.name}: no camera sees its points so")
