"""Photographed expressions as face units plus what is left: wrinkles come along with the units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.head import Head
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FACE, FaceState

MIN_SHARE = 0.05
"""Of a unit's whole movement: a region where it moves less has nothing to do with it."""
_RIDGE = 0.05
"""Ridge on how far expressions come along: of two that would do, both a little."""
_SUM_WEIGHT = 100.0
"""Weight of the condition that shares sum to 1."""
_REGION_BY_PREFIX = {
    "brow": "forehead",
    "cheekPuff": "mouth",
    "cheekSquint": "eye",
    "eye": "eye",
    "jaw": "mouth",
    "mouth": "mouth",
    "tongue": "mouth",
}
"""By how a unit's name begins; the others belong to the face."""
_WITHOUT_SIDE = {"jawLeft", "jawRight", "mouthLeft", "mouthRight"}
"""Their names end in a direction, not in a half of the face."""


@dataclass(frozen=True)
class RegionDecomposition:
    """The units of one region's expressions, made ready for being told apart.

    Attributes:
        expressions: (n,) those that have units here, counted without neutral.
        units: (U,) bool, those that any of them has.
        R: (n + 1, n + 1) upper triangular, and Q: (n + 1, U + 1) with orthonormal rows, without
            zeros' columns: least squares for n shares and what is missing to 1 of them.
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
        # One more unknown takes what is missing to 1, so that together they are at most 1.
        sum_to_one = np.full(count + 1, _SUM_WEIGHT)
        rows = np.column_stack([known[used].T, np.zeros(known.shape[1])])
        ridge = np.column_stack([_RIDGE * np.eye(count), np.zeros(count)])
        Q, R = np.linalg.qr(np.vstack([rows, sum_to_one, ridge]))
        answers = known.shape[1] + 1
        return cls(used, (known != 0).any(axis=0), frozen(R), frozen(Q[:answers].T.copy()))

    def shares(self, units: Float[Array, " u"]) -> Float[Array, " n"]:
        """(n,) from 0 up and at most 1 together, whose units are nearest to these."""
        from scipy.optimize import nnls

        wanted = units * self.units
        if not wanted.any() or not len(self.expressions):
            return np.zeros(len(self.expressions))
        return nnls(self.R, self.Q @ np.append(wanted, _SUM_WEIGHT))[0][:-1]


@dataclass(frozen=True)
class UnitDecomposition:
    """K photographed expressions explained by U units.

    Attributes:
        by_region: (R, K, U) weights of the units in each expression, as far as they concern each
            region; neutral's (row 0) are 0.
        residuals: (K, V, 3) mm, what of each expression its units do not explain.
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
            masks: (V, M); the regions are these and the rest of the head.
        """
        moved = np.linalg.norm(units, axis=2)
        total = np.maximum(moved.sum(axis=1), 1e-9)
        shares = (moved @ masks).T / total
        concerns = np.vstack([shares >= MIN_SHARE, np.ones(len(units), bool)])
        residuals = offsets - np.tensordot(weights, units, axes=1)
        residuals[0] = 0
        return cls(concerns[:, None, :] * weights[None], residuals)

    def expression_weights(self, units: Float[Array, " u"]) -> Float[Array, "r k-1"]:
        """(R, K - 1) how far each expression but neutral comes along with these units.

        In each region the mixture of expressions, weights from 0 up and at most 1 together, whose
        units are nearest to these.
        """
        driven = np.zeros((len(self.by_region), len(self.residuals) - 1))
        if units.any():
            for region, known in enumerate(self._regions):
                driven[region, known.expressions] = known.shares(units)
        return driven

    @cached_property
    def _regions(self) -> list[RegionDecomposition]:
        return [RegionDecomposition.of(known[1:]) for known in self.by_region]


def units_from_state(head: Head, state: FaceState) -> dict[str, float]:
    """Weights of the units that stand for a face: its own, and those that explain its expressions.

    Of an expression that holds in one region, the units of that region. What units do not explain,
    wrinkles above all, is lost.
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
    """The region that a unit moves: `mouthSmileLeft` is the left mouth's, `jawOpen` the mouth's."""
    region = next(
        (name for start, name in _REGION_BY_PREFIX.items() if unit.startswith(start)), FACE
    )
    if region == FACE:
        return FACE
    side = next((side for side in ("Left", "Right") if unit.endswith(side)), "")
    if side and unit not in _WITHOUT_SIDE:
        return f"{side.lower()}_{region}"
    return "eyes" if region == "eye" else region
