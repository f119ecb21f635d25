"""Initial cameras: local features of a photo matched with renderings from several sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.localization.keypoints import Keypoints, find_keypoints, match_keypoints
from mien.reconstruction.localization.photo_renderer import PX_PER_MM, PhotoRenderer, px_per_mm

_YAWS = (-90.0, -68.0, -46.0, 46.0, 68.0, 90.0)
"""Degrees. Features survive a turn by 15 degrees, the alignment that follows forgives 30."""
_DISTANCE_MM = 900.0
_BORDER_PX = 8
_EROSION_PX = 7
"""Nearer to the edge of what is visible, a feature describes the edge."""
_TOLERANCE_MM = 8.0
"""How far a match may lie off a reference view that is only moved, turned and scaled."""
_MIN_MATCHES = 4
_NEAREST_MM = 150.0
_MAX_STARTS = 4


@dataclass(frozen=True)
class ReferenceView:
    """A rendering of the head from one side.

    Attributes:
        camera: of the rendering; looks at the head's center.
        keypoints: in it.
    """

    camera: Camera
    keypoints: Keypoints


def reference_views(renderer: PhotoRenderer) -> tuple[ReferenceView, ...]:
    """The head from the sides from which no face is found, where the photos show it."""
    return tuple(_reference_view(renderer, yaw) for yaw in _YAWS)


def initial_cameras(
    grey: UInt8[Array, "h w"],
    template: Camera,
    references: Sequence[ReferenceView],
    center: Float[Array, " 3"],
) -> list[Camera]:
    """Cameras by a 2D similarity from a reference view to the photo, most inliers first.

    Of a profile with little skin four or five matches are right. A camera in space from so few
    is an accident (measured with EPnP); a shift, turn and scale is not.

    Args:
        grey: the photo.
        template: gives the photo's focal length, principal point and, roughly, the head's scale.
        references: renderings of the head.
        center: (3,) mm, of the head.
    """
    keypoints = find_keypoints(grey)
    starts = [
        _camera_by_similarity(reference, keypoints, template, center) for reference in references
    ]
    ordered = sorted((start for start in starts if start is not None), key=lambda start: -start[1])
    return [camera for camera, _ in ordered[:_MAX_STARTS]]


def _reference_view(renderer: PhotoRenderer, yaw: float) -> ReferenceView:
    camera = _camera_at(renderer, yaw)
    rendering = renderer.render(camera)
    return ReferenceView(camera, find_keypoints(rendering.grey, _eroded(rendering.visible)))


def _eroded(mask: Bool[Array, "h w"]) -> Bool[Array, "h w"]:
    import cv2

    kernel = np.ones((_EROSION_PX, _EROSION_PX), np.uint8)
    return cv2.erode(mask.astype(np.uint8), kernel) > 0


def _camera_at(renderer: PhotoRenderer, yaw: float) -> Camera:
    """Sees the head from so many degrees to its left, from the height of its middle."""
    rotation = np.diag([1.0, -1.0, -1.0]) @ rotation_from_vector(np.radians([0, -yaw, 0]))
    shift = np.array([0, 0, _DISTANCE_MM]) - rotation @ renderer.center
    camera = Camera(1, 1, PX_PER_MM * _DISTANCE_MM, rotation, shift, np.zeros(2))
    pixels = camera.project(renderer.corners)
    low, high = pixels.min(axis=0) - _BORDER_PX, pixels.max(axis=0) + _BORDER_PX
    width, height = np.ceil(high - low).astype(int).tolist()
    return replace(camera, width=width, height=height, principal_px=-low)


def _camera_by_similarity(
    reference: ReferenceView, keypoints: Keypoints, template: Camera, center: Float[Array, " 3"]
) -> tuple[Camera, int] | None:
    """The camera that shows the reference view moved, turned and scaled, and its inlier count."""
    import cv2

    pairs = match_keypoints(reference.keypoints, keypoints)
    if len(pairs) < _MIN_MATCHES:
        return None
    matrix, inliers = cv2.estimateAffinePartial2D(
        reference.keypoints.points[pairs[:, 0]],
        keypoints.points[pairs[:, 1]],
        ransacReprojThreshold=_TOLERANCE_MM * px_per_mm(template),
    )
    if matrix is None or inliers.sum() < _MIN_MATCHES:
        return None
    scale = float(np.hypot(*matrix[:, 0]))
    turn = np.eye(3)
    turn[:2, :2] = matrix[:, :2] / scale
    rotation = turn @ reference.camera.R_cam_head
    seen = matrix[:, :2] @ reference.camera.principal + matrix[:, 2]
    depth = template.focal_px / (scale * PX_PER_MM)
    toward = np.append((seen - template.principal) / template.focal_px, 1.0)
    shift = depth * toward - rotation @ center
    if shift[2] < _NEAREST_MM:
        return None
    return replace(template, R_cam_head=rotation, t_cam_head=shift), int(inliers.sum())
