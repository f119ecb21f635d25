"""Which frames of a clip make good photos of a head at rest: sharp, alike in expression, unlike in

pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES, DetectedFace, yaw_pitch

MAX_YAW = np.radians(50)
"""Past this the detector's landmarks are poor or missing."""

# Gaze follows the head and moves nothing that matters; "_neutral" is constant.
_SHAPED = np.array([name[0] != "_" and not name.startswith("eyeLook") for name in BLENDSHAPE_NAMES])
_OF_MOUTH = np.array([name.startswith(("mouth", "jaw", "cheekPuff")) for name in BLENDSHAPE_NAMES])
_SAME_EXPRESSION = 0.6
_OPEN_LIPS = 4.0
"""What lips that are apart by the distance of the eyes cost, in scores."""
_RESTLESS, _AT_REST = 0.35, 0.1
"""How much less at rest a frame may be than the one most at rest: where the head turns, for scores
shift with it, and where it does not."""
_SHARP_SHARE = 0.5
_SAME_POSE, _ONE_SIDE = np.radians(3), np.radians(10)


@dataclass(frozen=True)
class FrameScores:
    """What was measured on the sampled frames that show a face.

    Attributes:
        index: frame numbers in the clip, from 0.
        sharpness: any measure that grows with it.
        pose: yaw and pitch in radians.
        blendshapes: the detector's scores.
        lips_apart: gap between the lips over the distance of the eyes.
    """

    index: Int[Array, " n"]
    sharpness: Float[Array, " n"]
    pose: Float[Array, "n 2"]
    blendshapes: Float[Array, "n 52"]
    lips_apart: Float[Array, " n"]

    @classmethod
    def of(
        cls, index: Sequence[int], sharpness: Sequence[float], faces: Sequence[DetectedFace]
    ) -> Self:
        """The scores of the faces in these frames."""
        return cls(
            np.array(index),
            np.array(sharpness),
            np.array([yaw_pitch(face.R_cam_head) for face in faces]),
            np.array([face.blendshapes for face in faces]),
            np.array([face.lips_apart for face in faces]),
        )


def choose_frames(scores: FrameScores, count: int) -> Int[Array, " m"]:
    """Rows of `scores`, at most `count`, in the clip's order; at least one.

    Among frames that are sharp and show the face at rest, begins with the most frontal one and goes
    on to whichever pose is farthest from all chosen so far, taking the
    sharpest frame near that pose, until every pose left is within 3 degrees of a chosen one. Where
    the head turns by less than 10 degrees, the sharpest of those most at rest is enough.
    """
    usable = _usable(scores)
    pose, sharpness = scores.pose[usable], scores.sharpness[usable]
    if np.ptp(pose, axis=0).max() < _ONE_SIDE:
        # More would tell no depth, and blur the texture.
        unrest = _unrest(scores)[usable]
        at_rest = unrest <= unrest.min() + _AT_REST
        return usable[[int(np.where(at_rest, sharpness, -np.inf).argmax())]]
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
    return np.sort(usable[chosen])


def _usable(scores: FrameScores) -> Int[Array, " m"]:
    """Rows within reach of the detector, at rest, and sharp for their kind."""
    frontal = np.abs(scores.pose[:, 0]) <= MAX_YAW
    rows = np.flatnonzero(frontal if frontal.any() else np.ones_like(frontal))
    unrest = _unrest(scores)[rows]
    most = int(unrest.argmin())
    alike = expression_distance(scores.blendshapes[rows], most) <= _SAME_EXPRESSION
    rows = rows[alike & (unrest <= unrest[most] + _RESTLESS)]
    return sharp_rows(scores, rows)


def sharp_rows(scores: FrameScores, rows: Int[Array, " n"]) -> Int[Array, " m"]:
    """Those of the rows that are not blurred beside the others."""
    if not len(rows):
        return rows
    sharpness = scores.sharpness[rows]
    return rows[sharpness >= _SHARP_SHARE * np.median(sharpness)]


def _unrest(scores: FrameScores) -> Float[Array, " n"]:
    """How far each frame is from a face at rest.

    A mouth at rest is closed. What brows and eyes do at rest differs between people, as do the
    scores that the detector gives for it: it is what they do most of the time.
    """
    upper, mouth = scores.blendshapes[:, _SHAPED & ~_OF_MOUTH], scores.blendshapes[:, _OF_MOUTH]
    usual = np.linalg.norm(upper - np.median(upper, axis=0), axis=1)
    return usual + np.linalg.norm(mouth, axis=1) + _OPEN_LIPS * scores.lips_apart


def expression_distance(blendshapes: Float[Array, "n 52"], row: int) -> Float[Array, " n"]:
    """How far each frame's expression is from that of one: 0.2 is alike, 1.5 a broad smile."""
    shaped = blendshapes[:, _SHAPED]
    return np.linalg.norm(shaped - shaped[row], axis=1)
