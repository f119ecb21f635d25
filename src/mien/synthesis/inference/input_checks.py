"""What given points tell: that they are mirrored, another person's, or a moved head's."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError
from mien.numeric.planar_similarity import estimate_planar_motion
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.head_alignment import compensated
from mien.synthesis.inference.inferred import check_known

__all__ = ["ENOUGH_STATISTICS", "STRANGER", "face_width", "head_moved", "look_mirrored", "oddness"]

STRANGER = 0.8
"""The oddness from which points are likelier another person's, or of a head that is turned far.

Learned from every other stretch of seven clips: 4 in 100 of the other frames reach it, those of
another clip of the same person among them, and 2 or 3 in 100 pictures of fourteen others do
not.
"""

ENOUGH_STATISTICS = 20
"""From fewer expressions one cannot tell what is usual for a person."""

_LEAST_SPREAD = 0.005
"""Face widths by which a point may lie elsewhere in any expression that was seen."""

_BEYOND = 2.0
"""So much larger than those seen expressions may be, and the head still have stayed."""

_TURN, _SHIFT = 0.1, 0.3
"""Where the head may have gone: radians, or parts of its size; face widths."""


def face_width(layout: FeatureLayout, points: Float[Array, "n 2"]) -> float:
    """Of a face whose points these are, px, told by those that no expression moves.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    points = check_array("points", points, (len(layout.names), 2))
    rigid = layout.rigid
    return float(estimate_planar_motion(layout.template[rigid], points[rigid]).scale)


def look_mirrored(
    layout: FeatureLayout,
    neutral: Float[Array, "n 2"],
    known: Int[Array, " k"],
    positions: Float[Array, "k 2"],
) -> bool:
    """Whether the points fit a face better when right and left are exchanged.

    Right and left are the subject's; a picture that was flipped, or points named as the viewer
    sees them, look alike. Points of the midline alone never look mirrored. Of faces of nine
    people, with all points or some, none was taken for mirrored, and 99 in 100 of those that were
    mirrored were found; but for few points nearly on a line.

    Args:
        neutral: (n, 2) px of the face at rest.
        known: indices of points, none twice.
        positions: (k, 2) px of any picture.

    Raises:
        InputError: shapes, NaN, unknown or repeated points, fewer than two.
        EstimationError: all points in one place.
    """
    known, positions = check_known(known, positions, len(neutral))
    width = face_width(layout, neutral)
    as_given = _misfit(neutral[known], positions) / width
    exchanged = _misfit(neutral[layout.mirror[known]], positions) / width
    return as_given > 0.05 and exchanged < as_given / 2


def head_moved(
    examples: ExampleSet, known: Int[Array, " k"], positions: Float[Array, "k 2"]
) -> bool:
    """Whether a head that moved explains the points better than an expression alone.

    Both are compared by how likely they make the points: displacements as the statistics have
    them, twice as large, or those of a head that moved and turned in the plane as well. Few points
    tell little: then small movements are taken for expressions.

    Args:
        known: indices of points, none twice.
        positions: (k, 2) px of the neutral photo.

    Raises:
        InputError: no points, unknown or repeated ones, shapes, NaN.
    """
    neutral = examples.neutral.points
    known, positions = check_known(known, positions, len(neutral))
    width = face_width(examples.layout, neutral)
    seen = (examples.statistics - neutral)[:, known].reshape(len(examples.statistics), -1) / width
    given = ((positions - neutral[known]) / width).ravel() - seen.mean(axis=0)
    still = _BEYOND**2 * _spread(seen)
    motions = _motions(neutral / width)[:, known].reshape(4, -1)
    return _likelihood(given, still + motions.T @ motions) > _likelihood(given, still)


def oddness(examples: ExampleSet, points: Float[Array, "n 2"]) -> float | None:
    """How far a face's points are from what was seen of the person, in usual deviations.

    Args:
        points: (n, 2) px of any photo.

    Returns:
        the root of the mean square; from `STRANGER` on, points are likelier another person's. None
        where the statistics are too few to tell.

    Raises:
        InputError: shape, NaN.
        EstimationError: all points in one place.
    """
    if len(examples.statistics) < ENOUGH_STATISTICS:
        return None
    middle = examples.statistics.mean(axis=0)
    width = face_width(examples.layout, middle)
    seen, _ = compensated(examples.statistics, middle)
    geometry, _ = compensated(points, middle)
    apart = ((geometry - middle) / width).ravel()
    spread = _spread((seen - middle).reshape(len(seen), -1) / width)
    return float(np.sqrt(apart @ np.linalg.solve(spread, apart) / apart.size))


def _misfit(source: Float[Array, "k 2"], target: Float[Array, "k 2"]) -> float:
    """Root of the mean squared distance after the best motion, in the source's px."""
    if len(source) < 2:
        raise InputError("known", "at least 2 points", len(source))
    apart = estimate_planar_motion(source, target).undo(target) - source
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


def _spread(rows: Float[Array, "n d"]) -> Float[Array, "d d"]:
    """Covariance about the mean, and the least spread in every number."""
    apart = rows - rows.mean(axis=0)
    return apart.T @ apart / len(rows) + _LEAST_SPREAD**2 * np.eye(rows.shape[1])


def _motions(points: Float[Array, "n 2"]) -> Float[Array, "4 n 2"]:
    """What the head's growth, turn, and shifts, each by what is usual, do to the points."""
    x, y = (points - points.mean(axis=0)).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    ways = [(x, y), (-y, x), (one, zero), (zero, one)]
    usual = [_TURN, _TURN, _SHIFT, _SHIFT]
    return np.stack([by * np.stack(way, axis=-1) for by, way in zip(usual, ways, strict=True)])


def _likelihood(given: Float[Array, " d"], covariance: Float[Array, "d d"]) -> float:
    """Logarithm of a normal density, but for what all have in common."""
    size = np.linalg.slogdet(covariance)[1]
    return float(-0.5 * (given @ np.linalg.solve(covariance, given) + size))
