"""[Pighin 2002]'s linear steps of pose recovery: each solves for one group of unknowns.

The unknowns of photo k are s = f eta (px/mm), R, t = (t_x, t_y) mm and eta = 1 / t_z (1/mm); those
of point i are m_i (mm). With x the image point relative to the principal point, eq. (2) reads

    w (x + x eta (r_z . m) - s (r_xy . m + t)) = 0,    w = 1 / (1 + eta (r_z . m)),

linear in every group as long as w is held fixed, which each step does. All steps work on all
photos (or points) at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.rotation import rotation_from_vector

__all__ = [
    "Poses",
    "bounded_eta",
    "reprojection",
    "step_depth",
    "step_points",
    "step_rotation",
    "step_scale",
    "step_shift",
]

_NEAREST_MM, _FARTHEST_MM = 200.0, 100_000.0
_LEAST_DEPTH = 0.05
"""Floor of 1 + eta (r_z . m), so that a stray point behind a camera cannot turn the weights."""
_ANCHOR, _ANCHOR_SEEN_TWICE = 1e-8, 1e-13
"""Weights, relative to the data's, of a point's pull to its anchor: for what no ray settles."""


@dataclass(frozen=True)
class Poses:
    """The cameras' unknowns, one row a photo.

    Attributes:
        s: (K,) px/mm, scale at the head.
        R: (K, 3, 3).
        t: (K, 2) mm.
        eta: (K,) 1/mm.
    """

    s: Float[Array, " k"]
    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 2"]
    eta: Float[Array, " k"]

    @staticmethod
    def identity(photos: int) -> Poses:
        """Cameras 1 m away, looking along the head's z axis, at 1 px/mm."""
        turns = np.tile(np.eye(3), (photos, 1, 1))
        return Poses(np.ones(photos), turns, np.zeros((photos, 2)), np.full(photos, 1e-3))

    @staticmethod
    def stacked(parts: Sequence[Poses]) -> Poses:
        """The photos of all parts in one."""
        return Poses(
            np.concatenate([part.s for part in parts]),
            np.concatenate([part.R for part in parts]),
            np.concatenate([part.t for part in parts]),
            np.concatenate([part.eta for part in parts]),
        )

    def of(self, keep: Array) -> Poses:
        """Some of the photos, by mask or index."""
        return Poses(self.s[keep], self.R[keep], self.t[keep], self.eta[keep])


def reprojection(poses: Poses, points: Float[Array, "n 3"]) -> Float[Array, "k n 2"]:
    """(K, N, 2) px relative to the principal points. Source: [Pighin 2002] below eq. (1)."""
    rotated = _rotated(poses, points)
    above = poses.s[:, None, None] * (rotated[..., :2] + poses.t[:, None])
    return above / _depth(poses, rotated)[..., None]


def step_scale(poses: Poses, points: Array, image: Array, weights: Array) -> Poses:
    """Scale s of every photo. `image` is (K, N, 2) px, `weights` (K, N); 0 drops an observation."""
    rotated, w = _rotated_and_w(poses, points, weights)
    a = rotated[..., :2] + poses.t[:, None]
    b = image * (1 + poses.eta[:, None] * rotated[..., 2])[..., None]
    above, below = np.einsum("kn,knc,knc->k", w, a, b), np.einsum("kn,knc,knc->k", w, a, a)
    # A start turned by more than 90 degrees asks for a negative scale: refuse it.
    solved = (below > 0) & (above > 0)
    return replace(poses, s=np.where(solved, above / np.where(below > 0, below, 1), poses.s))


def step_points(
    poses: Poses, points: Array, image: Array, weights: Array, anchor: Array
) -> Float[Array, "n 3"]:
    """Points m. What no ray determines (a point seen once or never) is taken from anchor."""
    _, w = _rotated_and_w(poses, points, weights)
    s, eta = poses.s[:, None, None, None], poses.eta[:, None, None, None]
    a = image[..., None] * (eta * poses.R[:, None, 2:]) - s * poses.R[:, None, :2]
    b = poses.s[:, None, None] * poses.t[:, None] - image
    a_weighted = w[..., None, None] * a
    normal = np.einsum("knic,knid->ncd", a_weighted, a, optimize=True)
    right = np.einsum("knic,kni->nc", a_weighted, b, optimize=True)
    twice = np.count_nonzero(weights, axis=0) >= 2
    pull = np.where(twice, _ANCHOR_SEEN_TWICE, _ANCHOR)
    pull = pull * (np.trace(normal, axis1=1, axis2=2) + 1e-12)
    right -= np.einsum("ncd,nd->nc", normal, anchor)
    normal[:, range(3), range(3)] += pull[:, None]
    return anchor + np.linalg.solve(normal, right[..., None])[..., 0]


def step_rotation(poses: Poses, points: Array, image: Array, weights: Array) -> Poses:
    """R of every photo, by an incremental rotation.

    Source:
        [Pighin 2002] app. A, eq. (12) to (14).
    """
    q, w = _rotated_and_w(poses, points, weights)
    s, eta = poses.s[:, None], poses.eta[:, None]
    x, y = image[..., 0], image[..., 1]
    qx, qy, qz = np.moveaxis(q, -1, 0)
    row_x = np.stack([x * eta * qy, -x * eta * qx - s * qz, s * qy], axis=-1)
    row_y = np.stack([y * eta * qy + s * qz, -y * eta * qx, -s * qx], axis=-1)
    a = np.stack([row_x, row_y], axis=-2)
    b = s[..., None] * (q[..., :2] + poses.t[:, None]) - image * (1 + eta * qz)[..., None]
    a_weighted = w[..., None, None] * a
    normal = np.einsum("knic,knid->kcd", a_weighted, a, optimize=True)
    right = np.einsum("knic,kni->kc", a_weighted, b, optimize=True)
    normal[:, range(3), range(3)] += 1e-12 * (np.trace(normal, axis1=1, axis2=2)[:, None] + 1e-12)
    v = np.linalg.solve(normal, right[..., None])[..., 0]
    return replace(poses, R=rotation_from_vector(v) @ poses.R)


def step_shift(poses: Poses, points: Array, image: Array, weights: Array) -> Poses:
    """t_x and t_y of every photo."""
    rotated, w = _rotated_and_w(poses, points, weights)
    total = w.sum(axis=1)[:, None]
    depth = (1 + poses.eta[:, None] * rotated[..., 2])[..., None]
    b = image * depth / poses.s[:, None, None] - rotated[..., :2]
    mean = np.einsum("kn,knc->kc", w, b) / np.where(total > 0, total, 1)
    return replace(poses, t=np.where(total > 0, mean, poses.t))


def step_depth(poses: Poses, points: Array, image: Array, weights: Array) -> Poses:
    """Inverse depth eta of every photo, held to distances between 0.2 and 100 m."""
    rotated, w = _rotated_and_w(poses, points, weights)
    a = image * rotated[..., 2:]
    b = poses.s[:, None, None] * (rotated[..., :2] + poses.t[:, None]) - image
    below = np.einsum("kn,knc,knc->k", w, a, a)
    eta = np.einsum("kn,knc,knc->k", w, a, b) / np.where(below > 0, below, 1)
    return replace(poses, eta=bounded_eta(np.where(below > 0, eta, poses.eta)))


def bounded_eta(eta: Float[Array, " k"]) -> Float[Array, " k"]:
    """Inverse depth held to distances between 0.2 and 100 m."""
    return np.clip(eta, 1 / _FARTHEST_MM, 1 / _NEAREST_MM)


def _rotated(poses: Poses, points: Array) -> Float[Array, "k n 3"]:
    return points @ np.swapaxes(poses.R, 1, 2)


def _depth(poses: Poses, rotated: Array) -> Float[Array, "k n"]:
    """Depth over t_z, 1 / w of eq. (2)."""
    return np.maximum(1 + poses.eta[:, None] * rotated[..., 2], _LEAST_DEPTH)


def _rotated_and_w(poses: Poses, points: Array, weights: Array) -> tuple[Array, Array]:
    """R m and the squared row weights: the observations' times w^2, frozen within a step."""
    rotated = _rotated(poses, points)
    w: Array = weights / _depth(poses, rotated) ** 2
    return rotated, w
