"""Cameras that go around a head."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.arrays import Array, Float, check_array, check_positive
from mien.camera import FRONTAL, Camera
from mien.errors import InputError


def orbit_camera(
    yaw: float,
    pitch: float = 0.0,
    roll: float = 0.0,
    *,
    width: int,
    height: int,
    vertices: Float[Array, "v 3"],
    fov: float = np.radians(18),
    margin: float = 0.06,
) -> Camera:
    """A camera that sees all vertices, with the middle of their bounding box in its centre.

    Args:
        yaw: radians; positive moves the camera to the subject's left, so it is the opposite of
            `render_head`'s yaw, which turns the head.
        pitch: radians; positive looks down from above, as `render_head`'s.
        roll: radians; positive turns the head counter-clockwise in the picture.
        width: px.
        height: px.
        vertices: (V, 3) mm; the same for all cameras of an orbit, so that the scale is constant.
        fov: radians over the image's longer side; the default is a portrait lens.
        margin: share of the image that stays free on every side.

    Raises:
        InputError: shapes, sizes, a field of view of 0 or of pi and more, a margin of a half.
    """
    vertices = check_array("vertices", vertices, (None, 3))
    if not len(vertices):
        raise InputError("vertices", "at least one", "none")
    check_positive("width", width)
    check_positive("height", height)
    if not 0 < fov < np.pi:
        raise InputError("fov", "an angle between 0 and pi", fov)
    if not 0 <= margin < 0.5:
        raise InputError("margin", "a share from 0 to 0.5", margin)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    # The upright cylinder around the middle fits at every yaw, so that a turn keeps its scale.
    offsets = vertices - middle
    radius = float(np.hypot(offsets[:, 0], offsets[:, 2]).max())
    rise = float(np.abs(offsets[:, 1]).max())
    across = np.array([radius, rise * abs(np.cos(pitch)) + radius * abs(np.sin(pitch))])
    towards = radius * abs(np.cos(pitch)) + rise * abs(np.sin(pitch))
    across = np.abs(_about_z(roll)[:2, :2]) @ across
    focal = max(width, height) / 2 / np.tan(fov / 2)
    free = (0.5 - margin) * np.array([width, height])
    distance = max(float((across * focal / free).max()), 1e-3) + towards
    rotation = FRONTAL @ _turn_head(yaw, pitch)
    rotation = _about_z(-roll) @ rotation
    position = np.array([0.0, 0.0, distance]) - rotation @ middle
    return Camera(width, height, float(focal), rotation, position)


def turntable_cameras(
    frames: int,
    *,
    width: int,
    height: int,
    vertices: Float[Array, "v 3"],
    pitch: float = 0.0,
    fov: float = np.radians(18),
) -> Iterator[Camera]:
    """Cameras once around the head, starting in front, as a loop.

    Args:
        frames: number of cameras.
        width: px.
        height: px.
        vertices: (V, 3) mm, as for orbit_camera.
        pitch: radians, as for orbit_camera.
        fov: radians, as for orbit_camera.

    Raises:
        InputError: as orbit_camera; fewer than one frame.
    """
    check_positive("frames", frames)
    for frame in range(frames):
        yaw = 2 * np.pi * frame / frames
        yield orbit_camera(yaw, pitch, width=width, height=height, vertices=vertices, fov=fov)


def _turn_head(yaw: float, pitch: float) -> Float[Array, "3 3"]:
    """Rotation of the head equivalent to moving the camera by yaw and pitch."""
    c, s = np.cos(yaw), np.sin(yaw)
    about_y = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    c, s = np.cos(pitch), np.sin(pitch)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return about_x @ about_y


def _about_z(angle: float) -> Float[Array, "3 3"]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
