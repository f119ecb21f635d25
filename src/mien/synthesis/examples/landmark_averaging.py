"""Feature points of a picture, steadier than the detector's single look at it."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, UInt8, check_image
from mien.assets.feature_points import FeatureLayout
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import shrunk
from mien.errors import InputError
from mien.synthesis.examples.brow_correction import correct_brows

__all__ = ["ROTATIONS_DEG", "averaged_points"]

ROTATIONS_DEG = (0.0, 6.0, -6.0)
"""Degrees by which the face is turned in its plane, each as it is and mirrored."""

_SIDE, _WIDTHS = 512, 3.0
"""Of a view: px, and how many widths of the face. Nearer, a look is less steady."""
_FAR = 0.05
"""Points that are off by more than this share of the face's width, in the mean, are another's."""


def averaged_points(
    layout: FeatureLayout,
    detector: LandmarkDetector,
    pixels: UInt8[Array, "h w 3"],
    landmarks: Float[Array, "478 2"],
    *,
    turns: tuple[float, ...] = ROTATIONS_DEG,
) -> Float[Array, "n 2"]:
    """The mean of what the detector sees in a picture, turned and mirrored, brows where they are.

    Its landmarks jump by 1 px in a face of 250 px when the picture is turned by a few degrees, and
    by 2 px when it is mirrored: enough to blur what is mixed. Synthesised pictures gain 0.6 to
    1.5 dB by steady points (docs/synthesis-quality.md). Examples and the geometry that is
    asked for must be measured alike: steady points in one of both lose 0.4 to 0.8 dB.

    Args:
        landmarks: (478, 2) px, from a single look.
        turns: degrees, each as it is and mirrored; one look in some 10 ms each.

    Returns:
        (n, 2) px; the single look's where no other finds the face.

    Raises:
        InputError: no image, shapes, NaN, a face without width.
    """
    check_image("pixels", pixels)
    once = layout.from_landmarks(landmarks)
    width = float(np.ptp(once[:, 0]))
    if width == 0:
        raise InputError("landmarks", "a face with a width", "none")
    # Reduced before it is turned: what is turned is only looked up between pixels.
    factor = min(_SIDE / (_WIDTHS * width), 1.0)
    small = shrunk(pixels, max(round(factor * max(pixels.shape[:2])), 1))
    # By axis: sides are whole numbers of pixels.
    by = np.array(small.shape[1::-1]) / pixels.shape[1::-1]
    found = [
        _seen(layout, detector, small, by * once, np.radians(turn), mirrored) / by
        for turn in turns
        for mirrored in (False, True)
    ]
    # Another face may be larger in a cut-out than the one that is meant.
    near = [p for p in found if np.linalg.norm(p - once, axis=1).mean() < _FAR * width]
    return correct_brows(layout, pixels, np.mean(near, axis=0) if near else once)


def _seen(
    layout: FeatureLayout,
    detector: LandmarkDetector,
    pixels: UInt8[Array, "h w 3"],
    points: Float[Array, "n 2"],
    turn: float,
    mirrored: bool,
) -> Float[Array, "n 2"]:
    """The points as one look at the face, turned, tells them; infinity where it tells none."""
    import cv2

    matrix, offset = _view(points, turn, mirrored)
    # OpenCV counts from the first pixel's centre.
    shifted = offset + matrix @ [0.5, 0.5] - 0.5
    view = cv2.warpAffine(
        pixels, np.column_stack([matrix, shifted]), (_SIDE, _SIDE), borderMode=cv2.BORDER_REPLICATE
    )
    face = detector.detect_fast(np.asarray(view))
    if face is None:
        return np.full(points.shape, np.inf)
    seen = layout.from_landmarks(face.points[:, :2])
    back: Array = np.linalg.solve(matrix, (seen - offset).T).T
    return back[layout.mirror] if mirrored else back


def _view(
    points: Float[Array, "n 2"], turn: float, mirrored: bool
) -> tuple[Float[Array, "2 2"], Float[Array, " 2"]]:
    """A turn around the face's middle, which comes to the middle of the view."""
    cos, sin = np.cos(turn), np.sin(turn)
    matrix = np.array([[cos, -sin], [sin, cos]])
    if mirrored:
        matrix[0] *= -1
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return matrix, _SIDE / 2 - matrix @ middle
