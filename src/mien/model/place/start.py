"""Where a head might be in a photo: local features matched with how it looks from several sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8
from mien.camera import Camera
from mien.model.place.gallery import PX_PER_MM, Gallery, px_per_mm
from mien.model.place.keypoints import Keypoints, find_keypoints, match_keypoints
from mien.model.place.resect import find_camera
from mien.numeric.rotation import rotation_from_vector

_YAWS = (-90.0, -68.0, -46.0, 46.0, 68.0, 90.0)
"""Degrees: features survive a turn by some 15 degrees."""
_DISTANCE_MM = 900.0
_BORDER_PX = 8
_EROSION_PX = 7
"""Nearer to the edge of what is known, a feature describes the edge."""
_RIGID_MM, _FLAT_MM = 4.0, 8.0
"""How far matches may lie off: of a camera, of a picture that is only moved, turned and scaled."""
_FEWEST = 4
_NEAREST_MM = 150.0
_STARTS_FROM_LOOKS = 3


@dataclass(frozen=True)
class Look:
    """How the head looks from one side.

    Attributes:
        camera: of the picture. keypoints: in it. places: (N, 3) mm, where they lie on the head.
    """

    camera: Camera
    keypoints: Keypoints
    places: Float[Array, "n 3"]


def find_looks(gallery: Gallery) -> tuple[Look, ...]:
    """The head from the sides from which no face is found, as far as the photos tell."""
    return tuple(_look(gallery, _camera_at(gallery, yaw)) for yaw in _YAWS)


def find_starts(
    grey: UInt8[Array, "h w"], template: Camera, looks: Sequence[Look], gallery: Gallery
) -> list[Camera]:
    """Cameras that some of the matches between the photo and the looks agree on, best first.

    The first is the one that most matches of all looks agree on. Where that is an accident the
    following may be better: each lays one look flat onto the photo, which three or four true
    matches suffice for.

    Args:
        template: gives the photo's focal length, principal point and, roughly, the head's scale.
    """
    keypoints = find_keypoints(grey)
    matches = [match_keypoints(look.keypoints, keypoints) for look in looks]
    places = np.concatenate(
        [look.places[pairs[:, 0]] for look, pairs in zip(looks, matches, strict=True)]
    )
    seen = keypoints.places[np.concatenate(matches)[:, 1]]
    scale = px_per_mm(template)
    rigid = find_camera(places, seen, template, tolerance_px=_RIGID_MM * scale)
    flat = [
        _laid_flat(look, pairs, keypoints, template, gallery.center)
        for look, pairs in zip(looks, matches, strict=True)
    ]
    ordered = sorted((item for item in flat if item is not None), key=lambda item: -item[1])
    cameras = [camera for camera, _ in ordered[:_STARTS_FROM_LOOKS]]
    return cameras if rigid is None else [rigid, *cameras]


def _look(gallery: Gallery, camera: Camera) -> Look:
    painting = gallery.paint(camera)
    keypoints = find_keypoints(painting.grey, _eroded(painting.known))
    columns, rows = keypoints.places.astype(np.int64).T
    return Look(camera, keypoints, painting.places[rows, columns])


def _eroded(mask: Bool[Array, "h w"]) -> Bool[Array, "h w"]:
    import cv2

    kernel = np.ones((_EROSION_PX, _EROSION_PX), np.uint8)
    eroded: Array = cv2.erode(mask.astype(np.uint8), kernel) > 0
    return eroded


def _camera_at(gallery: Gallery, yaw: float) -> Camera:
    """Looks at the head from so many degrees on its left, from the height of its middle."""
    rotation = np.diag([1.0, -1.0, -1.0]) @ rotation_from_vector(np.radians([0, -yaw, 0]))
    shift = np.array([0, 0, _DISTANCE_MM]) - rotation @ gallery.center
    camera = Camera(1, 1, PX_PER_MM * _DISTANCE_MM, rotation, shift, np.zeros(2))
    pixels = camera.project(gallery.corners)
    low, high = pixels.min(axis=0) - _BORDER_PX, pixels.max(axis=0) + _BORDER_PX
    width, height = np.ceil(high - low).astype(int).tolist()
    return replace(camera, width=width, height=height, principal_px=-low)


def _laid_flat(
    look: Look,
    pairs: Int[Array, "m 2"],
    keypoints: Keypoints,
    template: Camera,
    center: Float[Array, " 3"],
) -> tuple[Camera, int] | None:
    """The camera that shows the look moved, turned and scaled as the matches say; their number."""
    import cv2

    if len(pairs) < _FEWEST:
        return None
    matrix, agreeing = cv2.estimateAffinePartial2D(
        look.keypoints.places[pairs[:, 0]],
        keypoints.places[pairs[:, 1]],
        ransacReprojThreshold=_FLAT_MM * px_per_mm(template),
    )
    if matrix is None or agreeing.sum() < _FEWEST:
        return None
    scale = float(np.hypot(*matrix[:, 0]))
    turn = np.eye(3)
    turn[:2, :2] = matrix[:, :2] / scale
    rotation = turn @ look.camera.R_cam_head
    seen = matrix[:, :2] @ look.camera.project(center[None])[0] + matrix[:, 2]
    depth = template.focal_px / (scale * PX_PER_MM)
    toward = np.append((seen - template.principal) / template.focal_px, 1.0)
    shift = depth * toward - rotation @ center
    if shift[2] < _NEAREST_MM:
        return None
    return replace(template, R_cam_head=rotation, t_cam_head=shift), int(agreeing.sum())
