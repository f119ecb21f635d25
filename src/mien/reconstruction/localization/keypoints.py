"""Local features of an image (SIFT) and their matches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8

_CONTRAST = 0.008
"""SIFT's threshold, a fifth of the usual: skin is smooth."""
_MAX_KEYPOINTS = 2500
_NEAREST_RATIO = 0.8
"""Lowe's test: the second nearest must be this much farther than the nearest."""


@dataclass(frozen=True)
class Keypoints:
    """N points of an image and their descriptors.

    Attributes:
        points: (N, 2) px.
        descriptors: (N, 128) of unit length.
    """

    points: Float[Array, "n 2"]
    descriptors: Float[Array, "n 128"]


def find_keypoints(grey: UInt8[Array, "h w"], mask: Bool[Array, "h w"] | None = None) -> Keypoints:
    """SIFT features, at most some thousand, the strongest.

    Source:
        Lowe, Distinctive image features from scale-invariant keypoints, 2004; Arandjelovic and
        Zisserman, Three things everyone should know, 2012 (the root of the descriptors).
    """
    import cv2

    allowed = None if mask is None else mask.astype(np.uint8)
    detector: Any = cv2.SIFT.create(_MAX_KEYPOINTS, contrastThreshold=_CONTRAST)
    found, sift = detector.detectAndCompute(grey, allowed)
    if sift is None:
        return Keypoints(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    points = np.array([keypoint.pt for keypoint in found]) + 0.5
    roots = np.sqrt(sift / np.maximum(sift.sum(axis=1, keepdims=True), 1e-6))
    return Keypoints(points, roots.astype(np.float32))


def match_keypoints(a: Keypoints, b: Keypoints) -> Int[Array, "m 2"]:
    """Indices into a and b of pairs that are each other's nearest, and by far."""
    if len(a.points) < 2 or len(b.points) < 2:
        return np.zeros((0, 2), np.int64)
    similarity = a.descriptors @ b.descriptors.T
    own, nearest = np.arange(len(similarity)), similarity.argmax(axis=1)
    mutual = similarity.argmax(axis=0)[nearest] == own
    first = _distance(similarity[own, nearest])
    similarity[own, nearest] = -1
    second = _distance(similarity.max(axis=1))
    kept = np.flatnonzero(mutual & (first < _NEAREST_RATIO * second))
    return np.column_stack([kept, nearest[kept]])


def _distance(similarity: Float[Array, " n"]) -> Float[Array, " n"]:
    """Between unit vectors of this scalar product."""
    return np.sqrt(np.maximum(2 - 2 * similarity, 0))
