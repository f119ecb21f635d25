"""Where a face holds still, by optical flow alone, and how much the tracked poses jitter there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.numeric.rotation import rotation_to_vector

__all__ = ["Jitter", "frame_motion", "jitter", "still_frames"]

_BELOW = 0.0075
"""Median motion of a still face from frame to frame, as a share of the distance of the eyes."""
_LEAST = 3
"""Frames of a stretch."""
_RIGHT_EYE, _LEFT_EYE = 468, 473


@dataclass(frozen=True)
class Jitter:
    """Root mean square second difference over still frames.

    Attributes:
        rotation: degrees.
        translation: percent of the head's distance.
        nose: px.
        frames: how many were looked at.
    """

    rotation: float
    translation: float
    nose: float
    frames: int


def frame_motion(
    frames: Sequence[UInt8[Array, "h w 3"]], points: Sequence[Float[Array, "478 2"] | None]
) -> Float[Array, " n"]:
    """(N,) median motion of corners from the frame before, over the distance of the eyes.

    Corners of the picture between brows and nose tip, followed by sparse optical flow; NaN for the
    first frame and where there is no face.

    Args:
        points: landmarks, which only bound the box in which corners are sought.
    """
    import cv2

    greys = [cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in frames]
    motion = np.full(len(frames), np.nan)
    for index in range(1, len(frames)):
        face = points[index - 1]
        if face is None or points[index] is None:
            continue
        eyes = float(np.linalg.norm(face[_RIGHT_EYE] - face[_LEFT_EYE]))
        box = _box(greys[0].shape, face, eyes)
        corners = cv2.goodFeaturesToTrack(greys[index - 1], 80, 0.01, max(2, eyes / 20), mask=box)
        if corners is None or len(corners) < 8:
            continue
        window = (max(9, round(eyes / 5)) | 1,) * 2
        moved, found, _ = cv2.calcOpticalFlowPyrLK(
            greys[index - 1], greys[index], corners, None, winSize=window
        )
        kept = found[:, 0] == 1
        off = np.linalg.norm((moved - corners)[kept, 0], axis=1)
        motion[index] = np.median(off) / eyes if kept.sum() >= 8 else np.nan
    return motion


def _box(shape: tuple[int, ...], face: Float[Array, "478 2"], eyes: float) -> UInt8[Array, "h w"]:
    """255 around eyes, brows and nose."""
    middle = (face[_RIGHT_EYE] + face[_LEFT_EYE]) / 2
    low, high = (middle + eyes * np.array(share) for share in ((-0.9, -0.6), (0.9, 0.7)))
    left, top = np.maximum(low, 0).astype(int)
    right, bottom = np.maximum(high, 0).astype(int)
    box = np.zeros(shape, np.uint8)
    box[top:bottom, left:right] = 255
    return box


def still_frames(
    motion: Float[Array, " n"], *, below: float = _BELOW, least: int = _LEAST
) -> Bool[Array, " n"]:
    """(N,) whether a frame and those beside it belong to a stretch in which the face is still.

    A second difference needs both neighbours: the motions into the frame and out of it count, and
    a stretch has so many frames at least.
    """
    quiet = np.append(motion[1:] < below, False) & (motion < below)
    still = np.zeros(len(motion), bool)
    start = 0
    for index in range(len(motion) + 1):
        if index < len(motion) and quiet[index]:
            continue
        if index - start >= least:
            still[start:index] = True
        start = index + 1
    return still


def jitter(
    rotations: Float[Array, "n 3 3"],
    translations: Float[Array, "n 3"],
    nose: Float[Array, "n 2"],
    still: Bool[Array, " n"],
) -> Jitter:
    """Of poses and of the nose's place in the picture; NaN where a frame is lost.

    Args:
        still: frames that count, if they and both neighbours are there.
    """
    lost = np.isnan(translations.sum(axis=1))
    middle = np.flatnonzero(still & ~lost)
    middle = middle[(middle > 0) & (middle < len(still) - 1)]
    middle = middle[~lost[middle - 1] & ~lost[middle + 1]]
    if not len(middle):
        return Jitter(np.nan, np.nan, np.nan, 0)
    before, here, after = (rotations[middle + step] for step in (-1, 0, 1))
    turns = rotation_to_vector(after @ here.swapaxes(1, 2))
    turns -= rotation_to_vector(here @ before.swapaxes(1, 2))
    distance = np.linalg.norm(translations[middle], axis=1, keepdims=True)
    shifts = _second(translations, middle) / distance
    return Jitter(
        _rms(np.degrees(turns)), _rms(100 * shifts), _rms(_second(nose, middle)), len(middle)
    )


def _second(values: Float[Array, "n c"], middle: Array) -> Float[Array, "m c"]:
    return values[middle + 1] - 2 * values[middle] + values[middle - 1]


def _rms(vectors: Float[Array, "n c"]) -> float:
    """Of their lengths."""
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))
