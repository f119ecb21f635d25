"""Whether given points are mirrored, those of another person, or of a head that has moved."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError
from mien.numeric.planar_similarity import estimate_planar_similarity
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.head_alignment import align_to_neutral
from mien.synthesis.inference.displacement_model import check_known

__all__ = [
    "MIN_STATISTICS",
    "OUTLIER_RMS",
    "face_width",
    "head_moved",
    "look_mirrored",
    "mahalanobis_rms",
]

OUTLIER_RMS = 0.8
"""The Mahalanobis RMS from which a face is rather another person's, or is turned far.

Learned from every other stretch of seven clips: 4 in 100 of the other frames reach it, those of
another clip of the same person among them, and 2 or 3 in 100 pictures of fourteen others do
not.
"""

MIN_STATISTICS = 20
"""Expressions; from fewer the covariance of a person's points cannot be estimated."""

_DEVIATION_FLOOR = 0.005
"""Face widths, of a point in any expression that was seen."""

_STILL_SCALE = 2.0
"""Expressions of a still head may be so many times as large as those of the statistics."""

_ROTATION_DEVIATION, _SHIFT_DEVIATION = 0.1, 0.3
"""Of a head's motion: radians, and likewise parts of its size; face widths."""


def face_width(layout: FeatureLayout, points: Float[Array, "n 2"]) -> float:
    """Width of a face, px, from those of its points that no expression moves.

    Args:
        layout: of the points.
        points: (n, 2) px.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    points = check_array("points", points, (len(layout.names), 2))
    rigid = layout.rigid
    return float(estimate_planar_similarity(layout.template[rigid], points[rigid]).scale)


def look_mirrored(
    layout: FeatureLayout,
    neutral: Float[Array, "n 2"],
    known: Int[Array, " k"],
    positions: Float[Array, "k 2"],
) -> bool:
    """Whether the points fit a face better when right and left are exchanged.

    Right and left are the subject's. A picture that was flipped and points that are named as the
    viewer sees them have the same effect. Points of the midline alone never look mirrored. Of
    faces of nine people, with all points or some, none was taken for mirrored, and 99 in 100 of
    those that were mirrored were found, except for few points nearly on a line.

    Args:
        layout: of the points.
        neutral: (n, 2) px of the face at rest.
        known: indices of points, none twice.
        positions: (k, 2) px of any picture.

    Raises:
        InputError: shapes, NaN, unknown or repeated points, fewer than two.
        EstimationError: all points in one place.
    """
    known, positions = check_known(known, positions, len(neutral))
    width = face_width(layout, neutral)
    as_given = _alignment_rms(neutral[known], positions) / width
    exchanged = _alignment_rms(neutral[layout.mirror[known]], positions) / width
    return as_given > 0.05 and exchanged < as_given / 2


def head_moved(
    examples: ExampleSet, known: Int[Array, " k"], positions: Float[Array, "k 2"]
) -> bool:
    """Whether a head that moved explains the points better than an expression alone.

    Compares the likelihood of the points under two normal distributions: displacements of the
    statistics, twice as large, without and with a motion of the head in the image plane. With few
    points, small motions are taken for expressions.

    Args:
        examples: of the person.
        known: indices of points, none twice.
        positions: (k, 2) px of the neutral photo.

    Raises:
        InputError: no points, unknown or repeated ones, shapes, NaN.
    """
    neutral = examples.neutral.points
    known, positions = check_known(known, positions, len(neutral))
    width = face_width(examples.layout, neutral)
    statistics = (examples.statistics - neutral)[:, known]
    statistics = statistics.reshape(len(examples.statistics), -1) / width
    centred = ((positions - neutral[known]) / width).ravel() - statistics.mean(axis=0)
    still = _STILL_SCALE**2 * _covariance(statistics)
    motions = _motion_basis(neutral / width)[:, known].reshape(4, -1)
    moved = still + motions.T @ motions
    return _log_likelihood(centred, moved) > _log_likelihood(centred, still)


def mahalanobis_rms(examples: ExampleSet, points: Float[Array, "n 2"]) -> float | None:
    """How far a face's points are from the statistics of the person, in standard deviations.

    Args:
        examples: of the person.
        points: (n, 2) px of any photo.

    Returns:
        the Mahalanobis distance over the root of the count of numbers; from `OUTLIER_RMS` on, the
        points are likelier another person's. None with fewer than `MIN_STATISTICS`.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    if len(examples.statistics) < MIN_STATISTICS:
        return None
    mean = examples.statistics.mean(axis=0)
    width = face_width(examples.layout, mean)
    statistics, _ = align_to_neutral(examples.statistics, mean)
    geometry, _ = align_to_neutral(points, mean)
    centred = ((geometry - mean) / width).ravel()
    covariance = _covariance((statistics - mean).reshape(len(statistics), -1) / width)
    return float(np.sqrt(centred @ np.linalg.solve(covariance, centred) / centred.size))


def _alignment_rms(source: Float[Array, "k 2"], target: Float[Array, "k 2"]) -> float:
    """Root of the mean squared distance after the best motion, in the source's px."""
    if len(source) < 2:
        raise InputError("known", "at least 2 points", len(source))
    residual = estimate_planar_similarity(source, target).inverse(target) - source
    return float(np.sqrt((residual**2).sum(axis=1).mean()))


def _covariance(rows: Float[Array, "n d"]) -> Float[Array, "d d"]:
    """Covariance about the mean, with the floor's variance added to every number."""
    centred = rows - rows.mean(axis=0)
    return centred.T @ centred / len(rows) + _DEVIATION_FLOOR**2 * np.eye(rows.shape[1])


def _motion_basis(points: Float[Array, "n 2"]) -> Float[Array, "4 n 2"]:
    """Displacements by one standard deviation of the head's scale, rotation, and two shifts."""
    x, y = (points - points.mean(axis=0)).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    directions = [(x, y), (-y, x), (one, zero), (zero, one)]
    deviations = [_ROTATION_DEVIATION, _ROTATION_DEVIATION, _SHIFT_DEVIATION, _SHIFT_DEVIATION]
    pairs = zip(deviations, directions, strict=True)
    return np.stack([deviation * np.stack(direction, axis=-1) for deviation, direction in pairs])


def _log_likelihood(centred: Float[Array, " d"], covariance: Float[Array, "d d"]) -> float:
    """Logarithm of a normal density without its constant term."""
    log_determinant = np.linalg.slogdet(covariance)[1]
    return float(-0.5 * (centred @ np.linalg.solve(covariance, centred) + log_determinant))
