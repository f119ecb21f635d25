"""Feature points of a picture averaged over several detections, less noisy than a single one."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, UInt8, check_image
from mien.assets.feature_points import FeatureLayout
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import downscale
from mien.errors import InputError
from mien.synthesis.examples.brow_correction import correct_brows

__all__ = ["ROTATIONS_DEG", "averaged_points"]

ROTATIONS_DEG = (0.0, 6.0, -6.0)
"""In the image plane; each is used as it is and mirrored. A detection takes some 10 ms."""

_SIDE, _WIDTHS = 512, 3.0
"""Of a crop: px, and widths of the face. Tighter crops are noisier."""
_MAX_DEVIATION = 0.05
"""Widths of the face; a detection farther off, in the mean, is of another face."""


def averaged_points(
    layout: FeatureLayout,
    detector: LandmarkDetector,
    pixels: UInt8[Array, "h w 3"],
    landmarks: Float[Array, "478 2"],
) -> Float[Array, "n 2"]:
    """The mean of detections in rotated and mirrored copies of a picture, brows corrected.

    The detector's landmarks jump by 1 px in a face of 250 px when the picture is rotated by a few
    degrees, and by 2 px when it is mirrored: enough to blur what is mixed. Synthesised pictures
    gain 0.6 to 1.5 dB by averaging. The points of the examples and those that are to be drawn must
    be measured in the same way: averaged points in one of both lose 0.4 to 0.8 dB.

    Args:
        layout: of the points.
        detector: of landmarks.
        pixels: (h, w, 3) sRGB.
        landmarks: (478, 2) px, from a single detection.

    Returns:
        (n, 2) px; from the single detection where no other finds the face.

    Raises:
        InputError: no image, shapes, NaN, a face without width.
    """
    check_image("pixels", pixels)
    single = layout.from_landmarks(landmarks)
    width = float(np.ptp(single[:, 0]))
    if width == 0:
        raise InputError("landmarks", "a face with a width", "none")
    # Reduced before it is rotated, as the warp only interpolates between pixels.
    factor = min(_SIDE / (_WIDTHS * width), 1.0)
    small = downscale(pixels, max(round(factor * max(pixels.shape[:2])), 1))
    # By axis: sides are whole numbers of pixels.
    scale = np.array(small.shape[1::-1]) / pixels.shape[1::-1]
    detections = [
        _detected(layout, detector, small, scale * single, np.radians(angle), mirrored) / scale
        for angle in ROTATIONS_DEG
        for mirrored in (False, True)
    ]
    # Another face may be larger in a crop than this one.
    inliers = [
        points
        for points in detections
        if np.linalg.norm(points - single, axis=1).mean() < _MAX_DEVIATION * width
    ]
    return correct_brows(layout, pixels, np.mean(inliers, axis=0) if inliers else single)


def _detected(
    layout: FeatureLayout,
    detector: LandmarkDetector,
    pixels: UInt8[Array, "h w 3"],
    points: Float[Array, "n 2"],
    angle: float,
    mirrored: bool,
) -> Float[Array, "n 2"]:
    """The points from one rotated crop of the face; infinity where no face is found."""
    import cv2

    matrix, offset = _crop_transform(points, angle, mirrored)
    # The centre of OpenCV's first pixel is 0, ours 0.5.
    shifted = offset + matrix @ [0.5, 0.5] - 0.5
    crop = cv2.warpAffine(
        pixels, np.column_stack([matrix, shifted]), (_SIDE, _SIDE), borderMode=cv2.BORDER_REPLICATE
    )
    face = detector.detect_fast(np.asarray(crop))
    if face is None:
        return np.full(points.shape, np.inf)
    in_crop = layout.from_landmarks(face.points[:, :2])
    restored: Array = np.linalg.solve(matrix, (in_crop - offset).T).T
    return restored[layout.mirror] if mirrored else restored


def _crop_transform(
    points: Float[Array, "n 2"], angle: float, mirrored: bool
) -> tuple[Float[Array, "2 2"], Float[Array, " 2"]]:
    """Rotation about the face's centre, which comes to the centre of the crop."""
    cos, sin = np.cos(angle), np.sin(angle)
    matrix = np.array([[cos, -sin], [sin, cos]])
    if mirrored:
        matrix[0] *= -1
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return matrix, _SIDE / 2 - matrix @ centre
