"""A face in face units alone, for formats that know no photographed expressions."""

from __future__ import annotations

from mien.head import Head
from mien.rig.regions import AROUND
from mien.rig.state import FACE, FaceState

_REGIONS = {
    "brow": "forehead",
    "cheekPuff": "mouth",
    "cheekSquint": "eye",
    "eye": "eye",
    "jaw": "mouth",
    "mouth": "mouth",
    "tongue": "mouth",
}
"""By how a unit's name begins; the others belong to the face."""
_WHOLE = {"jawLeft", "jawRight", "mouthLeft", "mouthRight"}
"""Their names end in a direction, not in a half of the face."""


def units_of(head: Head, state: FaceState) -> dict[str, float]:
    """Weights of the units that stand for a face: its own, and those that explain its expressions.

    Of an expression that holds in one region, the units of that region. What units do not explain,
    wrinkles above all, is lost.
    """
    total = dict(state.units)
    for unit in head.unit_names:
        region = region_of(unit)
        around = (name for name in (region, *AROUND[region]) if name in state.expressions)
        mixture = state.expressions.get(next(around, FACE), {})
        share = sum(
            weight * head.expressions[name].units.get(unit, 0.0) for name, weight in mixture.items()
        )
        if share:
            total[unit] = total.get(unit, 0.0) + share
    return total


def region_of(unit: str) -> str:
    """The region that a unit moves: `mouthSmileLeft` is the left mouth's, `jawOpen` the mouth's."""
    region = next((name for start, name in _REGIONS.items() if unit.startswith(start)), FACE)
    if region == FACE:
        return FACE
    side = next((side for side in ("Left", "Right") if unit.endswith(side)), "")
    if side and unit not in _WHOLE:
        return f"{side.lower()}_{region}"
    return "eyes" if region == "eye" else region
