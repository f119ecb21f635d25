"""Where the eyes look in a photo, from the irises' centres."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.faces.landmarks import inside_picture
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS
from mien.capture.source import CapturedView

EYEBALLS = {"left_eyeball": LEFT_IRIS, "right_eyeball": RIGHT_IRIS}
MAX_GAZE_RAD = np.deg2rad(45.0)
"""No eye turns farther."""


def iris_directions(
    view: CapturedView, camera: Camera, vertices: Float[Array, "v 3"], generic: GenericHead
) -> Float[Array, "2 3"] | None:
    """(2, 3) unit vectors from the centres of the left and the right eyeball to their irises.

    None where no landmarks are, or an iris lies outside of the photo.
    """
    if view.landmarks is None:
        return None
    irises = view.landmarks.points[list(EYEBALLS.values())]
    if not inside_picture(irises, view.photo.size).all():
        return None
    points = generic.landmark_positions(vertices)
    directions = np.empty((2, 3))
    for row, (name, iris) in enumerate(EYEBALLS.items()):
        ball = vertices[generic.mesh.vertices_of(name)]
        centre = ball.mean(axis=0)
        # A person's eyeball is no sphere: what counts is how far from its centre the iris lies.
        radius = float(np.linalg.norm(points[iris] - centre))
        point = view.landmarks.points[iris]
        directions[row] = direction_to_iris(camera, point, centre, radius)
    return directions


def direction_to_iris(
    camera: Camera, image_point: Float[Array, " 2"], centre: Float[Array, " 3"], radius: float
) -> Float[Array, " 3"]:
    """(3,) unit vector from an eyeball's centre to where a pixel's ray meets it.

    A ray that misses the ball grazes it.

    Args:
        camera: of the photo.
        image_point: (2,) px.
        centre: (3,) mm, head space.
        radius: mm.
    """
    ray = camera.ray_directions(image_point[None])[0]
    towards = centre - camera.center
    along = float(towards @ ray)
    off = towards - along * ray
    reach = np.sqrt(max(radius**2 - float(off @ off), 0.0))
    to_iris = (along - reach) * ray - towards
    return to_iris / np.linalg.norm(to_iris)


def yaw_pitch_from_directions(directions: Float[Array, "n 3"]) -> Float[Array, "n 2"]:
    """Radians to the subject's left, and up."""
    x, y, z = directions.T
    return np.column_stack([np.arctan2(x, z), np.arcsin(np.clip(y, -1, 1))])
