"""Clips as their frames' scores, made up."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.video.frame_selection import FrameScores


def scored(**units: float) -> Array:
    """(52,) the detector's scores: 0 but for those given; one without a side is that of both."""
    scores = np.zeros(52)
    for name, score in units.items():
        sides = [name] if name in BLENDSHAPE_NAMES else [f"{name}Left", f"{name}Right"]
        scores[[BLENDSHAPE_NAMES.index(side) for side in sides]] = score
    return scores


def clip(
    yaw: list[float],
    *,
    sharpness: list[float] | None = None,
    scores: list[Array] | None = None,
    lip_gap: list[float] | None = None,
) -> FrameScores:
    """Frames 0, 10, 20, ... with yaw in degrees; at rest, closed and sharp unless said."""
    count = len(yaw)
    return FrameScores(
        index=10 * np.arange(count),
        sharpness=np.array(sharpness or [1.0] * count),
        pose=np.column_stack([np.radians(yaw), np.zeros(count)]),
        blendshapes=np.stack(scores or [np.zeros(52)] * count),
        lip_gap=np.array(lip_gap or [0.0] * count),
    )
