"""[Pighin 2002]'s five linear steps, repeated until they settle, and accelerated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.numeric.solvers.anderson import AndersonAcceleration
from mien.numeric.solvers.robust import Loss
from mien.reconstruction.pose.linear_steps import (
    Poses,
    bounded_eta,
    reprojection,
    step_depth,
    step_points,
    step_rotation,
    step_scale,
    step_shift,
)

__all__ = ["Alternation", "alternate"]

_EXACT_PX = 1e-11
"""RMS reprojection error that is rounding."""
_PATIENCE = 5
"""Sweeps over which progress is judged."""


@dataclass(frozen=True)
class Alternation:
    """Where the five steps settled.

    Attributes:
        poses: the unknowns.
        points: the unknowns.
        cost: robust sum of squared reprojection errors, px^2.
        sweeps: rounds of five steps.
        converged: whether they settled before the limit.
    """

    poses: Poses
    points: Float[Array, "n 3"]
    cost: float
    sweeps: int
    converged: bool


def alternate(
    poses: Poses,
    points: Float[Array, "n 3"],
    image: Float[Array, "k n 2"],
    weights: Float[Array, "k n"],
    *,
    loss: Loss,
    sigma_px: float,
    history: int = 10,
    max_sweeps: int = 300,
    tolerance: float = 1e-8,
) -> Alternation:
    """Sweeps of the five steps until the cost stands still.

    The plain sweeps crawl along the valleys in which focal length trades with distance and relief
    with the angle between views. All that one sweep hands to the next is the poses, so it is a
    fixed-point iteration on them, and Anderson's method speeds it up: what it proposes is
    kept only if the next sweep finds a lower cost there, else the plain sweep's result is used.

    Args:
        poses: initial values.
        points: (N, 3) mm, initial values.
        image: (K, N, 2) px relative to the principal points.
        weights: (K, N), relative inverse variances, 0 unseen.
        loss: robust loss, and the deviation per axis of an observation of weight 1.
        sigma_px: robust loss, and the deviation per axis of an observation of weight 1.
        history: sweeps that the acceleration remembers; 0 is [Pighin 2002]'s plain iteration.
        max_sweeps: at most.
        tolerance: relative decrease of the cost over five sweeps at which they have settled.
    """
    anchor, frame = points, _Frame(poses, points)
    accelerate = AndersonAcceleration(history) if history else None
    costs: list[float] = []
    plain = poses
    for sweep in range(max_sweeps):
        moved, swept, cost = _sweep(poses, points, image, weights, anchor, loss, sigma_px)
        if poses is not plain and cost > costs[-1]:
            assert accelerate is not None
            accelerate.reset()
            poses = plain
            continue
        costs.append(cost)
        points, plain = moved, swept
        if _settled(costs, tolerance, float(weights.sum())):
            return Alternation(swept, points, cost, sweep + 1, True)
        if accelerate is None:
            poses = swept
        else:
            poses = frame.unpack(accelerate.propose(frame.pack(poses), frame.pack(swept)))
    return Alternation(plain, points, costs[-1], max_sweeps, False)


def _sweep(
    poses: Poses,
    points: Array,
    image: Array,
    weights: Array,
    anchor: Array,
    loss: Loss,
    sigma_px: float,
) -> tuple[Array, Poses, float]:
    """Points, the next poses, and the cost of these points under the poses given.

    The order is [Pighin 2002]'s, s, m, R, t, eta, entered at m. Points seen once fit any pose and
    would only hold the poses where they are, so they are left out of the cameras' steps.
    """
    bend = _bend(poses, points, image, weights, loss, sigma_px)[1]
    points = step_points(poses, points, image, weights * bend, anchor)
    values, bend = _bend(poses, points, image, weights, loss, sigma_px)
    cost = float(sigma_px**2 * values.sum())
    shared = weights * bend * (np.count_nonzero(weights, axis=0) >= 2)
    poses = step_rotation(poses, points, image, shared)
    poses = step_shift(poses, points, image, shared)
    poses = step_depth(poses, points, image, shared)
    poses = step_scale(poses, points, image, shared)
    return points, poses, cost


def _bend(
    poses: Poses, points: Array, image: Array, weights: Array, loss: Loss, sigma_px: float
) -> tuple[Array, Array]:
    squared = ((reprojection(poses, points) - image) ** 2).sum(axis=-1)
    return loss(weights * squared / sigma_px**2)


def _settled(costs: list[float], tolerance: float, observations: float) -> bool:
    if costs[-1] <= _EXACT_PX**2 * observations:
        return True
    return len(costs) > _PATIENCE and costs[-1 - _PATIENCE] - costs[-1] <= tolerance * costs[-1]


class _Frame:
    """Poses as one vector of comparable numbers: log s, rotation vectors, t and eta over size."""

    def __init__(self, poses: Poses, points: Array) -> None:
        self.reference = poses.R
        self.size = float(np.sqrt((points**2).sum(axis=1).mean()))

    def pack(self, poses: Poses) -> Float[Array, " n"]:
        turned = rotation_to_vector(poses.R @ np.swapaxes(self.reference, 1, 2))
        parts = (np.log(poses.s), turned, poses.t / self.size, poses.eta * self.size)
        return np.concatenate([part.ravel() for part in parts])

    def unpack(self, vector: Float[Array, " n"]) -> Poses:
        count = len(self.reference)
        s, turned, t, eta = np.split(vector, [count, 4 * count, 6 * count])
        return Poses(
            np.exp(s),
            rotation_from_vector(turned.reshape(count, 3)) @ self.reference,
            t.reshape(count, 2) * self.size,
            bounded_eta(eta / self.size),
        )
