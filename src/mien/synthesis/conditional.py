"""The motion of all feature points from that of a few, in closed form."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int, check_positive, frozen
from mien.numeric.pca import fit_pca
from mien.synthesis.inferred import LEAST_NOISE, Inferred, check_known, check_statistics

__all__ = ["CONDITIONAL_COMPONENTS", "ConditionalMotion"]

CONDITIONAL_COMPONENTS = 60
"""More do no harm, as the prior holds them; on filmed faces they bring nothing either."""


class ConditionalMotion:
    """The most likely displacements of all points, given some, for normally distributed ones.

    Displacements are taken as mean + B a + noise: columns of B are principal components of all
    points together times their standard deviations, a is standard normal, and noise is what the
    components leave, alike in every number. Then a is the regularised regression
    (B_k^T B_k + noise^2 I) a = B_k^T (given - mean_k) over the rows k of the known points.

    Args:
        statistics: (N, n, d) displacements from the neutral face of expressions of the same
            person, head motion compensated, px in a picture and mm in space; N >= 2.
        components: how many principal components are kept.
        least_noise: px or mm, the least that is taken for the noise: statistics that their
            components explain wholly do not make the given points beyond doubt.
    Raises: InputError: shapes, NaN, too few statistics, options out of their range.
    Source: Tipping and Bishop, Probabilistic principal component analysis, JRSS B 1999, for the
        model; the reference for Z06 sec. 10.
    """

    def __init__(
        self,
        statistics: Float[Array, "m n d"],
        *,
        components: int = CONDITIONAL_COMPONENTS,
        least_noise: float = LEAST_NOISE,
    ) -> None:
        statistics = check_statistics(statistics)
        pca = fit_pca(statistics.reshape(len(statistics), -1), components)
        self._mean = pca.mean.reshape(statistics.shape[1:])
        self._basis = (pca.components * pca.deviations[:, None]).reshape(-1, *self._mean.shape)
        self._noise = max(pca.residual, check_positive("least_noise", least_noise))

    def infer(self, known: Int[Array, " k"], displacements: Float[Array, "k d"]) -> Inferred:
        """The displacements of all points from those of some, in any order, in one step.

        Args:
            known: indices of points, none twice.
            displacements: (k, d) from the neutral face, head motion compensated.
        Raises: InputError: no points, unknown or repeated ones, NaN.
        """
        known, given = check_known(known, displacements, *self._mean.shape)
        rows = self._basis[:, known].reshape(len(self._basis), -1)
        normal = rows @ rows.T + self._noise**2 * np.eye(len(rows))
        weights = np.linalg.solve(normal, rows @ (given - self._mean[known]).ravel())
        moved: Array = self._mean + np.tensordot(weights, self._basis, axes=1)
        error = np.linalg.norm(moved[known] - given, axis=1).mean()
        return Inferred(frozen(moved), frozen(np.array([error])))
