"""Points in space from their images in cameras that are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array, check_positive
from mien.camera import Camera
from mien.errors import InputError

__all__ = ["Triangulation", "triangulate"]


@dataclass(frozen=True)
class Triangulation:
    """Points triangulated from viewing rays.

    Attributes:
        points: (N, 3) mm, head space; NaN where the rays leave them open.
        determined: (N,) True where at least two rays meet under a fair angle.
        residual_mm: (N,) root mean square distance from the point to its rays; NaN without rays.
        angle: (N,) radians, the largest angle between two of the rays; 0 with fewer than two.
        views: (N,) number of rays.
    """

    points: Float[Array, "n 3"]
    determined: Bool[Array, " n"]
    residual_mm: Float[Array, " n"]
    angle: Float[Array, " n"]
    views: Int[Array, " n"]


def triangulate(
    cameras: Sequence[Camera],
    image_points: Float[Array, "k n 2"],
    *,
    weights: Float[Array, "k n"] | None = None,
    current: Float[Array, "n 3"] | None = None,
    min_angle: float = np.deg2rad(2.0),
) -> Triangulation:
    """The points nearest to their viewing rays in the least-squares sense.

    Args:
        cameras: K of them.
        image_points: (K, N, 2) px, NaN where a camera does not show a point.
        weights: (K, N) >= 0 of the squared distances; equal unless given.
        current: (N, 3) mm, where the points are thought to be. With it, directions that the rays
            leave open (along the only ray, or along nearly parallel ones) are taken from there: a
            point seen once becomes the place on its ray nearest to `current`.
        min_angle: radians; rays closer than this do not tell depth.

    Raises:
        InputError: shapes, NaN in current, negative weights.

    Source:
        [Pighin 2002] sec. 5.1.3.
    """
    image = check_array("image_points", image_points, (len(cameras), None, 2), finite=False)
    count = image.shape[1]
    check_positive("min_angle", min_angle)
    weights = _ray_weights(image, weights)
    centers = np.stack([camera.center for camera in cameras])
    directions = _directions(cameras, image, weights > 0)
    across = np.eye(3) - directions[..., None] * directions[..., None, :]
    normal = np.einsum("kn,knij->nij", weights, across)
    right = np.einsum("kn,knij,kj->ni", weights, across, centers)
    views = np.count_nonzero(weights, axis=0)
    angle = _largest_angles(directions, weights > 0)
    solved = (views >= 2) & (angle >= min_angle)
    points = _solve(normal, right, solved, None, 0.0)
    if current is not None:
        current = check_array("current", current, (count, 3))
        least = 0.25 * np.sin(min_angle) ** 2 * weights.sum(axis=0)
        points = np.where(solved[:, None], points, _solve(normal, right, ~solved, current, least))
    off = np.einsum("knij,knj->kni", across, points - centers[:, None])
    total = np.where(views > 0, weights.sum(axis=0), np.nan)
    residual = np.sqrt(np.einsum("kn,kni,kni->n", weights, off, off) / total)
    return Triangulation(points, solved, residual, angle, views)


def _ray_weights(image: Array, weights: Array | None) -> Float[Array, "k n"]:
    seen: Array = np.asarray(np.isfinite(image).all(axis=2))
    weights = np.ones(seen.shape) if weights is None else weights
    weights = check_array("weights", weights, seen.shape)
    if (weights < 0).any():
        raise InputError("weights", "numbers of 0 or more", weights.min())
    return np.where(seen, weights, 0.0)


def _directions(
    cameras: Sequence[Camera], image: Array, seen: Bool[Array, "k n"]
) -> Float[Array, "k n 3"]:
    """Unit ray directions; along the optical axis where unseen (they carry no weight)."""
    return np.stack(
        [
            camera.ray_directions(np.where(see[:, None], pixels, camera.principal))
            for camera, pixels, see in zip(cameras, image, seen, strict=True)
        ]
    )


def _largest_angles(directions: Array, seen: Bool[Array, "k n"]) -> Float[Array, " n"]:
    largest = np.zeros(directions.shape[1])
    for first in range(len(directions)):
        for second in range(first):
            sine = np.linalg.norm(np.cross(directions[first], directions[second]), axis=1)
            cosine = (directions[first] * directions[second]).sum(axis=1)
            angle = np.where(seen[first] & seen[second], np.arctan2(sine, cosine), 0.0)
            largest = np.maximum(largest, angle)
    return largest


def _solve(
    normal: Array,
    right: Array,
    which: Bool[Array, " n"],
    current: Array | None,
    least: Float[Array, " n"] | float,
) -> Float[Array, "n 3"]:
    """Solutions of the normal equations; eigendirections below `least` keep the current place."""
    points = np.full(right.shape, np.nan)
    values, vectors = np.linalg.eigh(normal[which])
    known = values > (np.asarray(least)[which][:, None] if current is not None else 0.0)
    along = np.einsum("nij,ni->nj", vectors, right[which])
    coordinates = along / np.where(known, values, 1.0)
    if current is not None:
        kept = np.einsum("nij,ni->nj", vectors, current[which])
        coordinates = np.where(known, coordinates, kept)
    points[which] = np.einsum("nij,nj->ni", vectors, coordinates)
    return points
