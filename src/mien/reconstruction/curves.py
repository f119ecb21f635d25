"""Drawn curves turned into feature points: by arc length, or through a reference view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.camera import Camera
from mien.errors import InputError

__all__ = ["EpipolarPoints", "epipolar_lines", "match_curve", "resample_curve"]


_SAME_PLACE = 1e-9
"""Cameras nearer than this, relative to the head's distance, have no epipolar geometry."""


def resample_curve(
    curve: Float[Array, "m 2"], fractions: Float[Array, " n"] | int
) -> Float[Array, "n 2"]:
    """Points at given fractions of a curve's length.

    Args:
        curve: (M, 2) px, M >= 2, drawn as straight pieces; a repeated point counts once.
        fractions: (N,) in [0, 1], or a number of equally spaced points, ends included.

    Raises:
        InputError: fewer than two different points, NaN, a fraction outside of [0, 1].

    Source:
        [Pighin 2002] sec. 5.1.3, "stepping along them using an arc-length parameterization".
    """
    curve, lengths = _measured(curve)
    if isinstance(fractions, int):
        if fractions < 1:
            raise InputError("fractions", "one point or more", fractions)
        fractions = np.linspace(0, 1, fractions)
    return _at(curve, lengths, _checked_fractions(fractions, None))


@dataclass(frozen=True)
class EpipolarPoints:
    """A curve's points that correspond to a reference curve's.

    Attributes:
        points: (N, 2) px on the curve.
        fractions: (N,) of its length, never decreasing.
        matched: (N,) True where the epipolar line decided, False where arc length had to.
    """

    points: Float[Array, "n 2"]
    fractions: Float[Array, " n"]
    matched: Bool[Array, " n"]


def match_curve(
    reference_points: Float[Array, "n 2"],
    reference_camera: Camera,
    curve: Float[Array, "m 2"],
    camera: Camera,
    *,
    fractions: Float[Array, " n"] | None = None,
    max_shift: float = 0.25,
    min_angle: float = np.deg2rad(10.0),
) -> EpipolarPoints:
    """Where the epipolar lines of a reference curve's points cross the same curve in another view.

    Of several crossings the sequence is chosen that runs along the curve in order and lies
    nearest to the arc-length positions. Where a line misses the curve, or meets it at so
    flat an angle that the crossing slides along it, the position is taken by arc length
    between the matched neighbours.

    Args:
        reference_points: (N, 2) px in order along the curve in the reference photo.
        reference_camera: of the reference photo.
        curve: (M, 2) px, the same curve drawn in the other photo, in the same direction.
        camera: of the other photo.
        fractions: (N,) in [0, 1], increasing: the reference points' arc-length positions; equally
            spaced unless given.
        max_shift: how far, as a fraction of length, a crossing may lie from its arc-length place.
        min_angle: radians between line and curve, below which a crossing is not used.

    Raises:
        InputError: shapes, NaN, a curve of fewer than two points, decreasing fractions.

    Source:
        [Pighin 2002] sec. 5.1.3, the alternative parameterization.
    """
    reference_points = check_array("reference_points", reference_points, (None, 2))
    count = len(reference_points)
    expected = np.linspace(0, 1, count) if fractions is None else fractions
    expected = _checked_fractions(expected, count)
    if (np.diff(expected) < 0).any():
        raise InputError("fractions", "numbers that do not fall", "some that do")
    curve, lengths = _measured(curve)
    lines = epipolar_lines(reference_points, reference_camera, camera)
    candidates = []
    for line, place in zip(lines, expected, strict=True):
        crossings = _crossings(line, curve, lengths, min_angle)
        candidates.append(crossings[np.abs(crossings - place) <= max_shift])
    chosen = _monotone_choice(candidates, expected, max_shift)
    matched = np.isfinite(chosen)
    chosen = _filled(chosen, expected)
    return EpipolarPoints(_at(curve, lengths, chosen), chosen, matched)


def epipolar_lines(
    points: Float[Array, "n 2"], source: Camera, target: Camera
) -> Float[Array, "n 3"]:
    """Epipolar lines of the source's image points in the target's px.

    Lines (a, b, c) with a x + b y + c = 0, a^2 + b^2 = 1; NaN where the cameras coincide.
    """
    to_target = target.R_cam_head @ source.R_cam_head.T
    shift = target.t_cam_head - to_target @ source.t_cam_head
    if np.linalg.norm(shift) < _SAME_PLACE * np.linalg.norm(target.t_cam_head):
        return np.full((len(points), 3), np.nan)
    rays = np.column_stack([(points - source.principal) / source.focal_px, np.ones(len(points))])
    normals = np.cross(shift, rays @ to_target.T)
    # A plane n . X = 0 through the camera meets the image in n . ((x - c) / f, 1) = 0.
    lines = np.column_stack(
        [
            normals[:, :2] / target.focal_px,
            normals[:, 2] - normals[:, :2] @ target.principal / target.focal_px,
        ]
    )
    size = np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    return np.divide(lines, size, out=np.full(lines.shape, np.nan), where=size > 0)


def _checked_fractions(fractions: object, count: int | None) -> Float[Array, " n"]:
    checked = check_array("fractions", fractions, (count,))
    out = np.abs(checked - 0.5) > 0.5 + 1e-9
    if out.any():
        raise InputError("fractions", "numbers from 0 to 1", checked[out][0])
    return np.clip(checked, 0, 1)


def _measured(curve: Array) -> tuple[Float[Array, "m 2"], Float[Array, " m"]]:
    """The curve without repeated points, and the fraction of its length at each."""
    curve = check_array("curve", curve, (None, 2))
    moves = np.ones(len(curve), bool)
    moves[1:] = (np.diff(curve, axis=0) != 0).any(axis=1)
    curve = curve[moves]
    if len(curve) < 2:
        raise InputError("curve", "two different points or more", len(curve))
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    return curve, lengths / lengths[-1]


def _at(curve: Array, lengths: Array, fractions: Array) -> Float[Array, "n 2"]:
    return np.column_stack([np.interp(fractions, lengths, curve[:, axis]) for axis in (0, 1)])


def _crossings(line: Array, curve: Array, lengths: Array, min_angle: float) -> Float[Array, " c"]:
    """Fractions of the curve's length at which the line crosses it, in order."""
    if not np.isfinite(line).all():
        return np.empty(0)
    offset = curve @ line[:2] + line[2]
    before, after = offset[:-1], offset[1:]
    slope = (after - before) / np.linalg.norm(np.diff(curve, axis=0), axis=1)
    crossed = (before * after <= 0) & (np.abs(slope) >= np.sin(min_angle))
    share = before[crossed] / (before - after)[crossed]
    fractions = lengths[:-1][crossed] + share * np.diff(lengths)[crossed]
    return np.unique(fractions)


def _monotone_choice(
    candidates: list[Array], expected: Float[Array, " n"], max_shift: float
) -> Float[Array, " n"]:
    """One candidate or none (NaN) a point, never decreasing, nearest to expected overall.

    Dynamic programming over the last matched point; passing a point over costs `max_shift`.
    """
    ends: list[tuple[float, int, float, int]] = []  # cost, point, fraction, index of predecessor
    best_end, best_cost = -1, max_shift * len(expected)
    for point, options in enumerate(candidates):
        earlier = len(ends)
        for fraction in options:
            cost, link = max_shift * point, -1
            for index in range(earlier):
                cost_before, point_before, fraction_before, _ = ends[index]
                total = cost_before + max_shift * (point - point_before - 1)
                if fraction_before <= fraction and total < cost:
                    cost, link = total, index
            cost += abs(float(fraction) - float(expected[point]))
            ends.append((cost, point, float(fraction), link))
            finished = cost + max_shift * (len(expected) - point - 1)
            if finished < best_cost:
                best_end, best_cost = len(ends) - 1, finished
    chosen = np.full(len(expected), np.nan)
    while best_end >= 0:
        _, point, fraction, link = ends[best_end]
        chosen[point], best_end = fraction, link
    return chosen


def _filled(chosen: Float[Array, " n"], expected: Float[Array, " n"]) -> Float[Array, " n"]:
    """Unmatched places by arc length between the matched ones and the curve's ends."""
    known = np.isfinite(chosen)
    places = np.concatenate([[0.0], expected[known], [1.0]])
    fractions = np.concatenate([[0.0], chosen[known], [1.0]])
    return np.where(known, chosen, np.interp(expected, places, fractions))
