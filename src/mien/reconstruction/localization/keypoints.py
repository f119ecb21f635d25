"""Local features of an image, alike in two images of the same place from nearby sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8

_CONTRAST = 0.008
"""SIFT's threshold, a fifth of the usual: skin is smooth."""
_MOST = 2500
_NEAREST_RATIO = 0.8
"""Lowe's test: the second nearest must be this much farther than the nearest."""


@dataclass(frozen=True)
class Keypoints:
    """N places of an image and what surrounds them.

    Attributes:
        places: (N, 2) px.
        descriptors: (N, 128) of unit length.
    """

    places: Float[Array, "n 2"]
    descriptors: Float[Array, "n 128"]


def find_keypoints(grey: UInt8[Array, "h w"], mask: Bool[Array, "h w"] | None = None) -> Keypoints:
    """SIFT features, at most some thousand, the strongest.

    Source:
        Lowe, Distinctive image features from scale-invariant keypoints, 2004; Arandjelovic and
        Zisserman, Three things everyone should know, 2012 (the root of the descriptors).
    """
    import cv2

    allowed = None if mask is None else mask.astype(np.uint8)
    detector: Any = cv2.SIFT.create(_MOST, contrastThreshold=_CONTRAST)
    found, sift = detector.detectAndCompute(grey, allowed)
    if sift is None:
        return Keypoints(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    places = np.array([keypoint.pt for keypoint in found]) + 0.5
    roots = np.sqrt(sift / np.maximum(sift.sum(axis=1, keepdims=True), 1e-6))
    return Keypoints(places, roots.astype(np.float32))


def match_keypoints(a: Keypoints, b: Keypoints) -> Int[Array, "m 2"]:
    """Indices into a and b of pairs that are each other's nearest, and by far."""
    if len(a.places) < 2 or len(b.places) < 2:
        return np.zeros((0, 2), np.int64)
    likeness = a.descriptors @ b.descriptors.T
    own, nearest = np.arange(len(likeness)), likeness.argmax(axis=1)
    mutual = likeness.argmax(axis=0)[nearest] == own
    first = _distance(likeness[own, nearest])
    likeness[own, nearest] = -1
    second = _distance(likeness.max(axis=1))
    kept = np.flatnonzero(mutual & (first < _NEAREST_RATIO * second))
    return np.column_stack([kept, nearest[kept]])


def _distance(likeness: Float[Array, " n"]) -> Float[Array, " n"]:
    """Between unit vectors of this scalar product."""
    return np.sqrt(np.maximum(2 - 2 * likeness, 0))
