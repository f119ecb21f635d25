"""Which frames of a clip make good photos of a head: sharp, alike in expression, unlike in pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.mediapipe_face import BLENDSHAPE_NAMES

MAX_YAW = np.radians(50)
"""Past this the detector's landmarks are poor or missing."""

# Gaze follows the head and moves nothing that matters; "_neutral" is constant.
_SHAPED = np.array([name[0] != "_" and not name.startswith("eyeLook") for name in BLENDSHAPE_NAMES])
_COMMON_SHARE = 0.1
_SAME_EXPRESSION = 0.6
_SHARP_SHARE = 0.5
_SAME_POSE = np.radians(3)


@dataclass(frozen=True)
class FrameScores:
    """What was measured on the sampled frames that show a face.

    Attributes:
        index: frame numbers in the clip, from 0.
        sharpness: any measure that grows with it.
        pose: yaw and pitch in radians.
        blendshapes: the detector's scores.
    """

    index: Int[Array, " n"]
    sharpness: Float[Array, " n"]
    pose: Float[Array, "n 2"]
    blendshapes: Float[Array, "n 52"]


def choose_frames(scores: FrameScores, count: int) -> Int[Array, " m"]:
    """Rows of `scores`, at most `count`, in the clip's order; at least one.

    Among frames that are sharp and near the clip's commonest expression, begins with the most
    frontal one and goes on to whichever pose is farthest from all chosen so far, taking the
    sharpest frame near that pose, until every pose left is within 3 degrees of a chosen one.
    """
    usable = _usable(scores)
    pose, sharpness = scores.pose[usable], scores.sharpness[usable]
    distance = np.linalg.norm(pose, axis=1)
    target = int(distance.argmin())
    distance = np.full(len(pose), np.inf)
    chosen: list[int] = []
    while len(chosen) < count and distance.max() > _SAME_POSE:
        near = np.linalg.norm(pose - pose[target], axis=1) <= _SAME_POSE / 2
        best = int(np.argmax(np.where(near, sharpness, -np.inf)))
        chosen.append(best)
        distance = np.minimum(distance, np.linalg.norm(pose - pose[best], axis=1))
        target = int(distance.argmax())
    rows: Array = np.sort(usable[chosen])
    return rows


def _usable(scores: FrameScores) -> Int[Array, " m"]:
    """Rows within reach of the detector, alike in expression, and sharp for their kind."""
    frontal = np.abs(scores.pose[:, 0]) <= MAX_YAW
    rows = np.flatnonzero(frontal if frontal.any() else np.ones_like(frontal))
    rows = rows[expression_distance(scores.blendshapes[rows]) <= _SAME_EXPRESSION]
    sharpness = scores.sharpness[rows]
    sharp: Array = rows[sharpness >= _SHARP_SHARE * np.median(sharpness)]
    return sharp


def expression_distance(blendshapes: Float[Array, "n 52"]) -> Float[Array, " n"]:
    """How far each frame's expression is from the commonest: 0.2 is alike, 1.5 a broad smile.

    The commonest is the frame with the nearest tenth of the clip closest around it.
    """
    shaped = blendshapes[:, _SHAPED]
    apart = np.linalg.norm(shaped[:, None] - shaped[None], axis=2)
    neighbour = int(_COMMON_SHARE * (len(shaped) - 1))
    commonest = int(np.sort(apart, axis=1)[:, neighbour].argmin())
    distances: Array = apart[commonest]
    return distances
