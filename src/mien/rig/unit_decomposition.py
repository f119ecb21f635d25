"""Photographed expressions decomposed into face units and a residual, such as wrinkles.

When units are animated, the residuals of the expressions whose units are nearest are added too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.head import Head
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FACE, FaceState

MIN_SHARE = 0.05
"""Least share of a unit's movement in a region for the unit to belong to it."""
_RIDGE = 0.05
"""Ridge on the expression weights: where two expressions fit equally, both get some weight."""
_SUM_WEIGHT = 100.0
"""Weight of the condition that expression weights sum to 1."""
_REGION_BY_PREFIX = {
    "brow": "forehead",
    "cheekPuff": "mouth",
    "cheekSquint": "eye",
    "eye": "eye",
    "jaw": "mouth",
    "mouth": "mouth",
    "tongue": "mouth",
}
"""Region by the beginning of a unit's name; other units belong to the face."""
_WITHOUT_SIDE = {"jawLeft", "jawRight", "mouthLeft", "mouthRight"}
"""Units whose names end in a direction, not in a side of the face."""


@dataclass(frozen=True)
class RegionDecomposition:
    """Least squares from unit weights to expression weights in one region, factorized.

    Attributes:
        expressions: (n,) indices of those that have units here, neutral not counted.
        units: (U,) bool, those that any of these expressions has.
        R: (n + 1, n + 1) upper triangular; the unknowns are n weights and the slack that brings
            their sum to 1.
        Q: (n + 1, U + 1) transposed, only the columns whose right-hand side is not 0.
    """

    expressions: Int[Array, " n"]
    units: Bool[Array, " u"]
    R: Float[Array, "m m"]
    Q: Float[Array, "m u+1"]

    @classmethod
    def of(cls, known: Float[Array, "k-1 u"]) -> RegionDecomposition:
        """From the weights of the units in each expression but neutral."""
        used = np.flatnonzero((known**2).sum(axis=1) > 1e-6)
        count = len(used)
        # A slack unknown makes the condition an inequality: the weights sum to at most 1.
        sum_to_one = np.full(count + 1, _SUM_WEIGHT)
        rows = np.column_stack([known[used].T, np.zeros(known.shape[1])])
        ridge = np.column_stack([_RIDGE * np.eye(count), np.zeros(count)])
        Q, R = np.linalg.qr(np.vstack([rows, sum_to_one, ridge]))
        observations = known.shape[1] + 1
        return cls(used, (known != 0).any(axis=0), frozen(R), frozen(Q[:observations].T.copy()))

    def weights(self, units: Float[Array, " u"]) -> Float[Array, " n"]:
        """(n,) non-negative weights, sum at most 1, of the mixture with the nearest units."""
        from scipy.optimize import nnls

        observed = units * self.units
        if not observed.any() or not len(self.expressions):
            return np.zeros(len(self.expressions))
        return nnls(self.R, self.Q @ np.append(observed, _SUM_WEIGHT))[0][:-1]


@dataclass(frozen=True)
class UnitDecomposition:
    """K photographed expressions as U units and residuals.

    Attributes:
        by_region: (R, K, U) weights of the units in each expression, 0 for units that do not belong
            to the region; those of neutral (row 0) are 0.
        residuals: (K, V, 3) mm, offsets of each expression that its units do not explain.
    """

    by_region: Float[Array, "r k u"]
    residuals: Float[Array, "k v 3"]

    @classmethod
    def of(
        cls,
        weights: Float[Array, "k u"],
        units: Float[Array, "u v 3"],
        offsets: Float[Array, "k v 3"],
        masks: Float[Array, "v m"],
    ) -> UnitDecomposition:
        """From unit weights and offsets of the expressions, neutral first.

        Args:
            weights: (K, U) of the units in each expression.
            units: (U, V, 3) mm.
            offsets: (K, V, 3) mm.
            masks: (V, M); the regions are these and the rest of the head.
        """
        moved = np.linalg.norm(units, axis=2)
        total = np.maximum(moved.sum(axis=1), 1e-9)
        shares = (moved @ masks).T / total
        belongs = np.vstack([shares >= MIN_SHARE, np.ones(len(units), bool)])
        residuals = offsets - np.tensordot(weights, units, axes=1)
        residuals[0] = 0
        return cls(belongs[:, None, :] * weights[None], residuals)

    def expression_weights(self, units: Float[Array, " u"]) -> Float[Array, "r k-1"]:
        """(R, K - 1) weights of the expressions but neutral that fit these unit weights best.

        In each region the mixture with the nearest units; weights are non-negative and sum to at
        most 1.
        """
        weights = np.zeros((len(self.by_region), len(self.residuals) - 1))
        if units.any():
            for region, known in enumerate(self._regions):
                weights[region, known.expressions] = known.weights(units)
        return weights

    @cached_property
    def _regions(self) -> list[RegionDecomposition]:
        return [RegionDecomposition.of(known[1:]) for known in self.by_region]


def units_from_state(head: Head, state: FaceState) -> dict[str, float]:
    """Weights of units that approximate a face: its own, and those of its expressions.

    An expression that holds in one region adds the units of that region. Residuals, above all
    wrinkles, are lost.
    """
    total = dict(state.units)
    for unit in head.unit_names:
        region = unit_region(unit)
        around = (
            name for name in (region, *ENCLOSING_REGIONS[region]) if name in state.expressions
        )
        mixture = state.expressions.get(next(around, FACE), {})
        share = sum(
            weight * head.expressions[name].units.get(unit, 0.0) for name, weight in mixture.items()
        )
        if share:
            total[unit] = total.get(unit, 0.0) + share
    return total


def unit_region(unit: str) -> str:
    """The region that a unit moves: left_mouth for `mouthSmileLeft`, mouth for `jawOpen`."""
    region = next(
        (name for start, name in _REGION_BY_PREFIX.items() if unit.startswith(start)), FACE
    )
    if region == FACE:
        return FACE
    side = next((side for side in ("Left", "Right") if unit.endswith(side)), "")
    if side and unit not in _WITHOUT_SIDE:
        return f"{side.lower()}_{region}"
    return "eyes" if region == "eye" else region
