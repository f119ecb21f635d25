"""Normal equations of many small groups of unknowns tied together by a few common ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.errors import EstimationError

__all__ = ["BlockSystem"]

_OPEN = 1e-9
"""A block whose eigenvalues differ by more than this ratio is not determined."""


@dataclass(frozen=True)
class BlockSystem:
    """[[common, coupling], [coupling^T, blocks]] x = -gradient, blocks on the diagonal only.

    Attributes:
        common: (D, D).
        blocks: (N, B, B).
        coupling: (N, D, B).
        common_gradient: (D,).
        block_gradient: (N, B).
    """

    common: Float[Array, "d d"]
    blocks: Float[Array, "n b b"]
    coupling: Float[Array, "n d b"]
    common_gradient: Float[Array, " d"]
    block_gradient: Float[Array, "n b"]

    def solve(self, damping: float) -> tuple[Float[Array, " d"], Float[Array, "n b"], float]:
        """The damped step (common part, blocks) and the fall of the quadratic that it predicts.

        The damping is added relative to the diagonal (Marquardt).
        """
        common_extra = damping * _diagonal(self.common)
        block_extra = damping * _diagonal(self.blocks)
        common, blocks = self.common.copy(), self.blocks.copy()
        np.einsum("ii->i", common)[:] += common_extra
        np.einsum("nii->ni", blocks)[:] += block_extra
        damped = replace(self, common=common, blocks=blocks)
        step = _solve_positive(*damped.reduced())
        block_step = damped.block_step(step)
        fall = step @ (common_extra * step - self.common_gradient)
        fall += (block_step * (block_extra * block_step - self.block_gradient)).sum()
        return step, block_step, 0.5 * float(fall)

    def reduced(self) -> tuple[Float[Array, "d d"], Float[Array, " d"]]:
        """The Schur complement of the blocks, and the right side: equations of the common part."""
        coupling, gradient = self._whitened
        return (
            self.common - coupling.T @ coupling,
            coupling.T @ gradient - self.common_gradient,
        )

    def eliminate(
        self,
        matrix: Float[Array, "a d"],
        coupling: Float[Array, "n a b"],
        right: Float[Array, " a"],
    ) -> tuple[Float[Array, "a d"], Float[Array, " a"]]:
        """Equations matrix @ common + sum coupling_n @ block_n = right without the blocks."""
        own = _flat(self._inverse_root @ np.swapaxes(coupling, 1, 2))
        common, gradient = self._whitened
        return matrix - own.T @ common, right + own.T @ gradient

    def block_step(self, common: Float[Array, " d"]) -> Float[Array, "n b"]:
        """(N, B) steps of the blocks that go with a step of the common unknowns."""
        coupling, gradient = self._whitened
        whitened = (gradient + coupling @ common).reshape(self.block_gradient.shape)
        return -np.einsum("nij,ni->nj", self._inverse_root, whitened)

    @cached_property
    def _inverse_root(self) -> Float[Array, "n b b"]:
        """Inverses of the blocks' Cholesky factors."""
        return np.linalg.inv(np.linalg.cholesky(self.blocks))

    @cached_property
    def _whitened(self) -> tuple[Float[Array, "n*b d"], Float[Array, " n*b"]]:
        """Coupling and block gradient in units in which every block is the identity."""
        coupling = self._inverse_root @ np.swapaxes(self.coupling, 1, 2)
        gradient = np.einsum("nij,nj->ni", self._inverse_root, self.block_gradient)
        return _flat(coupling), gradient.ravel()

    def covariance(
        self, constraints: Float[Array, "n q b"] | None = None
    ) -> tuple[Float[Array, "d d"], Float[Array, "n b b"]]:
        """Covariances of the common unknowns and of each block, for unit residual variance.

        Args:
            constraints: (N, Q, B), Q linear combinations of the block unknowns, summed over blocks,
                that are held at zero: as many as the data leave free for all together.

        Returns:
            (D, D) and (N, B, B), infinite for a block that the data do not determine.

        Raises:
            EstimationError: the constraints leave something free.
        """
        # A block that its data leave partly open has no coupling along the open directions.
        own = np.linalg.pinv(self.blocks, rcond=_OPEN, hermitian=True)
        common, coupling, is_open = self.common, self.coupling, self.open_blocks()
        if constraints is not None:
            # Lagrange's multipliers join the common unknowns.
            count = constraints.shape[1]
            common = np.pad(common, (0, count))
            held = np.where(is_open[:, None, None], 0.0, constraints)
            coupling = np.concatenate([coupling, held], axis=1)
        response = own @ np.swapaxes(coupling, 1, 2)
        reduced = common - _flat(np.swapaxes(coupling, 1, 2)).T @ _flat(response)
        inverse = _inverse(reduced)
        covariances = own + response @ inverse @ np.swapaxes(response, 1, 2)
        size = len(self.common)
        return inverse[:size, :size], np.where(is_open[:, None, None], np.inf, covariances)

    def open_blocks(self) -> Bool[Array, " n"]:
        """Which blocks the data do not determine even if the common unknowns were known."""
        strengths = np.linalg.eigvalsh(self.blocks)
        return strengths[:, 0] <= _OPEN * strengths[:, -1]


def _diagonal(matrices: Array) -> Array:
    """The diagonals, with a floor that keeps unknowns without data where they are."""
    diagonal: Array = np.einsum("...ii->...i", matrices)
    floor = max(1e-12 * float(diagonal.max(initial=0.0)), 1e-300)
    return np.maximum(diagonal, floor)


def _flat(coupling: Float[Array, "n b d"]) -> Float[Array, "n*b d"]:
    """As one matrix, so that a sum over blocks is one product."""
    return coupling.reshape(-1, coupling.shape[2])


def _solve_positive(matrix: Array, right: Array) -> Array:
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    scale = 1 / np.sqrt(_diagonal(matrix))
    try:
        factor = cho_factor(matrix * np.outer(scale, scale))
        solution: Array = scale * cho_solve(factor, scale * right)
    except LinAlgError:
        solution = (
            scale * np.linalg.lstsq(matrix * np.outer(scale, scale), scale * right, rcond=1e-12)[0]
        )
    return solution


def _inverse(matrix: Array) -> Array:
    """Of a symmetric, perhaps indefinite matrix."""
    diagonal = np.abs(np.diagonal(matrix))
    scale = 1 / np.sqrt(np.maximum(diagonal, max(1e-12 * float(diagonal.max()), 1e-300)))
    scaled = matrix * np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e15:
        raise EstimationError("some unknowns are not determined by the data")
    return np.linalg.inv(scaled) * np.outer(scale, scale)
