"""Anderson acceleration of a fixed-point iteration x <- g(x)."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float

__all__ = ["AndersonAcceleration"]


class AndersonAcceleration:
    """Proposes the next iterate from the last few pairs (x, g(x)).

    It takes the combination of past iterates whose combined residual g(x) - x is shortest, and
    returns the same combination of the g(x). The caller may refuse the proposal, and calls `reset`
    then.

    Args:
        depth: how many past differences are used.
        regularization: relative ridge of the small least-squares problem.

    Source:
        Walker and Ni, Anderson acceleration for fixed-point iterations, SINUM 2011.
    """

    def __init__(self, depth: int, *, regularization: float = 1e-10) -> None:
        self.depth, self.regularization = depth, regularization
        self.reset()

    def reset(self) -> None:
        """Drop the history."""
        self._iterates: list[Array] = []
        self._images: list[Array] = []

    def propose(self, iterate: Float[Array, " n"], image: Float[Array, " n"]) -> Float[Array, " n"]:
        """The next iterate, from the latest one x and its image g(x)."""
        self._iterates = [*self._iterates[-self.depth :], iterate]
        self._images = [*self._images[-self.depth :], image]
        images = np.stack(self._images, axis=1)
        residuals = images - np.stack(self._iterates, axis=1)
        if residuals.shape[1] == 1:
            return image
        change = np.diff(residuals, axis=1)
        scale = np.linalg.norm(change, axis=0)
        change = change / np.where(scale > 0, scale, 1.0)
        normal = change.T @ change + self.regularization * np.eye(change.shape[1])
        mixing = np.linalg.solve(normal, change.T @ residuals[:, -1])
        mixing = mixing / np.where(scale > 0, scale, 1.0)
        return image - np.diff(images, axis=1) @ mixing
