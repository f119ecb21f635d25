"""Which frames of a clip show different expressions, and what to call them."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.video.frame_selection import FrameScores, expression_distance, sharp_rows

MIN_DISTANCE = 0.55
"""Scores that two expressions of one person differ by at least."""
MAX_EXPRESSIONS = 8
"""Expressions besides neutral, unless a number is asked for."""
_NEAR = 0.25
"""Frames this near to the farthest one show the same expression: the sharpest is taken."""
_MAX_YAW = np.radians(25)
"""One frame has to show the whole face."""

_WORDS = {
    "browDown": "brows_down",
    "browInnerUp": "brows_up",
    "browOuterUp": "brows_up",
    "cheekPuff": "puffed_cheeks",
    "cheekSquint": "squint",
    "eyeBlink": "eyes_closed",
    "eyeSquint": "squint",
    "eyeWide": "wide_eyes",
    "jawForward": "jaw_forward",
    "jaw": "jaw_aside",
    "jawOpen": "open_mouth",
    "mouth": "mouth_aside",
    "mouthDimple": "dimples",
    "mouthFrown": "frown",
    "mouthFunnel": "funnel",
    "mouthLowerDown": "lower_teeth",
    "mouthPress": "pressed_lips",
    "mouthPucker": "pucker",
    "mouthRollLower": "rolled_lips",
    "mouthRollUpper": "rolled_lips",
    "mouthShrugLower": "shrug",
    "mouthShrugUpper": "shrug",
    "mouthSmile": "smile",
    "mouthStretch": "stretched_lips",
    "mouthUpperUp": "upper_teeth",
    "noseSneer": "sneer",
}
_FALLING = {"browInnerUp": "brows_down", "browOuterUp": "brows_down"}
"""Lowered brows show less in their own score than in that of raised ones."""
_MIN_CHANGE = 0.2
"""Scores that change less have no part in an expression's name."""


def choose_expressions(
    scores: FrameScores, neutral: int, count: int | None = None
) -> Int[Array, " m"]:
    """Rows of frames that show unlike expressions, from the most different one on.

    Begins with the frame farthest from the neutral one and goes on with whichever is farthest from
    all that are chosen, as long as that is a different expression and not more than `count`.

    Args:
        scores: of the frames.
        neutral: row of a frame with the face at rest.
        count: how many at most; None picks up to 8.
    """
    rows = sharp_rows(scores, np.flatnonzero(np.abs(scores.pose[:, 0]) <= _MAX_YAW))
    distance = expression_distance(scores.blendshapes, neutral)
    chosen: list[int] = []
    while len(rows) and len(chosen) < (MAX_EXPRESSIONS if count is None else count):
        farthest = int(rows[distance[rows].argmax()])
        if distance[farthest] < MIN_DISTANCE:
            break
        away = expression_distance(scores.blendshapes, farthest)
        near = rows[(away[rows] <= _NEAR) & (distance[rows] >= MIN_DISTANCE)]
        best = int(near[scores.sharpness[near].argmax()])
        chosen.append(best)
        distance = np.minimum(distance, expression_distance(scores.blendshapes, best))
        distance = np.minimum(distance, away)
    return np.array(chosen, np.int64)


def name_expressions(
    blendshapes: Float[Array, "n 52"], neutral: Float[Array, " 52"]
) -> tuple[str, ...]:
    """A name for each by the scores that change most: "smile"; if that is taken, "smile-brows_up".

    Args:
        blendshapes: scores of N expressions.
        neutral: those of the face at rest.
    """
    names: list[str] = []
    for scores in blendshapes:
        words = _words(scores - neutral) or ["expression"]
        candidates = ["-".join(words[:length]) for length in (1, 2, 3)]
        candidates += [f"{words[0]}-{number}" for number in range(2, len(blendshapes) + 2)]
        names.append(next(name for name in candidates if name not in names))
    return tuple(names)


def _words(change: Float[Array, " 52"]) -> list[str]:
    """Words for the scores that change, the largest change first, each once."""
    found: dict[str, None] = {}
    for k in np.argsort(-np.abs(change)):
        unit = BLENDSHAPE_NAMES[k].removesuffix("Left").removesuffix("Right")
        words = _WORDS if change[k] > 0 else _FALLING
        if abs(change[k]) >= _MIN_CHANGE and unit in words:
            found[words[unit]] = None
    return list(found)
