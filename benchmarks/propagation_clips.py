"""Expressions of filmed faces, split into statistics and held-out ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.feature_points import FeatureLayout
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.video import Video
from mien.synthesis.examples.head_alignment import align_to_neutral

__all__ = ["KNOWN", "HeldOut", "held_out", "known_points", "most_different"]

BLOCK = 15
"""Frames that are not split, so that no held-out frame has its neighbour in the statistics."""
EXPRESSIONS = 25
IMAGE_HEIGHT = 1000
"""Of [Zhang 2006]'s images, 750 wide: clips are cut to that shape at their full height."""


def _sides(*names: str) -> tuple[str, ...]:
    return tuple(f"{side}_{name}" for name in names for side in ("right", "left"))


_FIVE = (*_sides("brow_upper.1", "mouth_corner"), "menton")
_SEVENTEEN = (
    *_sides("brow_upper.0", "brow_upper.2", "brow_upper.4", "upper_eyelid.1", "lower_eyelid.1"),
    *_sides("mouth_corner", "nose_wing.1"),
    *("upper_lip_outer", "lower_lip_outer", "menton"),
)
_TWENTY_SEVEN = (
    *_SEVENTEEN,
    *_sides("eye_outer", "upper_lip_outer.1", "lower_lip_outer.1", "inner_mouth_corner"),
    *_sides("nasolabial.1"),
)
_FORTY = (
    *_TWENTY_SEVEN,
    *_sides("brow_lower.1", "jaw.1", "eye_bag.0", "cheek.1"),
    *("upper_lip_inner", "lower_lip_inner", "nose_tip", "forehead", "chin"),
)
KNOWN = {len(names): names for names in (_FIVE, _SEVENTEEN, _TWENTY_SEVEN, _FORTY)}
"""Points that trackers find: brows, lids, wings of the nose, lips, chin."""


@dataclass(frozen=True)
class HeldOut:
    """Displacements from the neutral face, px at an image of 750x1000.

    Attributes:
        statistics: (N, n, 2) of all frames of odd blocks.
        truth: (25, n, 2) the most different ones of even blocks.
        neutral: (n, 2) the frame that is nearest to the median of the statistics.
    """

    statistics: Float[Array, "m n 2"]
    truth: Float[Array, "e n 2"]
    neutral: Float[Array, "n 2"]

    def few(self, count: int) -> HeldOut:
        """The same, learned from the most different expressions only."""
        return replace(self, statistics=self.statistics[most_different(self.statistics, count)])

    def aligned_by(self, known: Int[Array, " k"], *, statistics: bool) -> HeldOut:
        """The same, head motion of the truth estimated from the known points alone.

        Args:
            known: indices of points.
            statistics: that of the statistics as well.
        """
        truth = self._aligned(known, self.truth)
        aligned = self._aligned(known, self.statistics) if statistics else self.statistics
        return replace(self, truth=truth, statistics=aligned)

    def _aligned(self, known: Array, displacements: Array) -> Array:
        geometries, _ = align_to_neutral(displacements + self.neutral, self.neutral, subset=known)
        return geometries - self.neutral


def held_out(clip: Path, layout: FeatureLayout, detector: LandmarkDetector) -> HeldOut:
    """A clip's expressions, as the detector sees them in its frames."""
    found = []
    for frame in Video(clip).frames():
        face = detector.detect_fast(frame.pixels())
        if face is not None:
            points = layout.from_landmarks(face.points[:, :2])
            found.append((frame.index, points * (IMAGE_HEIGHT / frame.size[1])))
    points = np.array([points for _, points in found])
    odd = np.array([index for index, _ in found]) // BLOCK % 2 == 1
    neutral = _nearest_to_median(points[odd])
    displacements = align_to_neutral(points, neutral)[0] - neutral
    chosen = most_different(displacements[~odd], EXPRESSIONS)
    return HeldOut(displacements[odd], displacements[~odd][chosen], neutral)


def known_points(layout: FeatureLayout, count: int) -> Int[Array, " k"]:
    """Indices of so many points."""
    return np.array([layout.index(name) for name in KNOWN[count]])


def most_different(displacements: Float[Array, "m n 2"], count: int) -> Int[Array, " c"]:
    """Indices of expressions, each the farthest from those before, the strongest first."""
    rows = displacements.reshape(len(displacements), -1)
    distances = np.linalg.norm(rows, axis=1)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(distances.argmax()))
        from_latest = np.linalg.norm(rows - rows[chosen[-1]], axis=1)
        distances = from_latest if len(chosen) == 1 else np.minimum(distances, from_latest)
    return np.array(chosen)


def _nearest_to_median(points: Float[Array, "m n 2"]) -> Float[Array, "n 2"]:
    geometries, _ = align_to_neutral(points, points[0])
    distances = np.linalg.norm(geometries - np.median(geometries, axis=0), axis=-1).sum(axis=-1)
    return points[distances.argmin()]
