"""Selection of a clip's frames of the head at rest: sharp, of one expression, of many poses."""

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
_EXPRESSIVE = np.array(
    [name[0] != "_" and not name.startswith("eyeLook") for name in BLENDSHAPE_NAMES]
)
_MOUTH = np.array([name.startswith(("mouth", "jaw", "cheekPuff")) for name in BLENDSHAPE_NAMES])
_SAME_EXPRESSION = 0.6
_LIP_GAP_COST = 4.0
"""Score that is added for a lip gap of one eye distance."""
_MAX_EXCESS, _MAX_EXCESS_STILL = 0.35, 0.1
"""Distance from rest beyond the smallest one of all frames: where the head turns, as scores shift
with it, and where it does not."""
_MIN_SHARPNESS = 0.5
_SAME_POSE, _ONE_SIDE = np.radians(3), np.radians(10)


@dataclass(frozen=True)
class FrameScores:
    """Measures of the sampled frames that show a face.

    Attributes:
        index: frame numbers in the clip, from 0.
        sharpness: in any unit.
        pose: yaw and pitch in radians.
        blendshapes: the detector's scores.
        lip_gap: gap between the lips over the eye distance.
    """

    index: Int[Array, " n"]
    sharpness: Float[Array, " n"]
    pose: Float[Array, "n 2"]
    blendshapes: Float[Array, "n 52"]
    lip_gap: Float[Array, " n"]

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
            np.array([face.lip_gap for face in faces]),
        )


def choose_frames(scores: FrameScores, count: int) -> Int[Array, " m"]:
    """Rows of `scores`, at most `count`, in the clip's order; at least one.

    Among frames that are sharp and show the face at rest, begins with the most frontal one and goes
    on to whichever pose is farthest from all chosen so far, taking the sharpest frame near that
    pose, until every pose left is within 3 degrees of a chosen one. Where the head turns by less
    than 10 degrees, the sharpest of those most at rest is enough.

    Args:
        scores: of the frames.
        count: how many at most.
    """
    usable = _usable(scores)
    pose, sharpness = scores.pose[usable], scores.sharpness[usable]
    if np.ptp(pose, axis=0).max() < _ONE_SIDE:
        # More views would not determine depth, and blur the texture.
        distances = distance_from_rest(scores)[usable]
        at_rest = distances <= distances.min() + _MAX_EXCESS_STILL
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
    """Rows of frames near enough to frontal, at rest, and sharp beside the others."""
    frontal = np.abs(scores.pose[:, 0]) <= MAX_YAW
    rows = np.flatnonzero(frontal if frontal.any() else np.ones_like(frontal))
    distances = distance_from_rest(scores)[rows]
    most = int(distances.argmin())
    alike = expression_distance(scores.blendshapes[rows], most) <= _SAME_EXPRESSION
    rows = rows[alike & (distances <= distances[most] + _MAX_EXCESS)]
    return sharp_rows(scores, rows)


def sharp_rows(scores: FrameScores, rows: Int[Array, " n"]) -> Int[Array, " m"]:
    """Those of the rows that are not blurred, by the median sharpness of all."""
    if not len(rows):
        return rows
    sharpness = scores.sharpness[rows]
    return rows[sharpness >= _MIN_SHARPNESS * np.median(sharpness)]


def distance_from_rest(scores: FrameScores) -> Float[Array, " n"]:
    """Distance of each frame's expression from a face at rest.

    A mouth at rest is closed. Brows and eyes at rest differ between people, as do their scores:
    their rest is the median over the frames.
    """
    upper, mouth = scores.blendshapes[:, _EXPRESSIVE & ~_MOUTH], scores.blendshapes[:, _MOUTH]
    brows_and_eyes = np.linalg.norm(upper - np.median(upper, axis=0), axis=1)
    return brows_and_eyes + np.linalg.norm(mouth, axis=1) + _LIP_GAP_COST * scores.lip_gap


def expression_distance(blendshapes: Float[Array, "n 52"], row: int) -> Float[Array, " n"]:
    """Distance of each frame's expression from that of one row: 0.2 is alike, 1.5 a broad smile."""
    shaped = blendshapes[:, _EXPRESSIVE]
    return np.linalg.norm(shaped - shaped[row], axis=1)
