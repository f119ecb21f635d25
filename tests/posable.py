"""A head with made-up expressions, known exactly: units, a smooth bump, turned eyes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from expressive import bump, weights_of
from marbled import GENERIC
from mien.arrays import Array
from mien.head import ATLAS, Expression, Head
from mien.rig.gaze import with_turned_eyes

REST = np.asarray(GENERIC.mesh.vertices, np.float64)
NAMES = ("neutral", "joy", "anger", "awe")
ANGER_GAZE = np.array([[0.25, -0.1], [0.2, -0.1]])
UNITS: Mapping[str, dict[str, float]] = {
    "joy": {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.6},
    "anger": {"browDownLeft": 1.0, "browDownRight": 0.9, "mouthPressLeft": 0.4},
    "awe": {"jawOpen": 0.8, "browInnerUp": 0.7},
}
_BUMPS = {
    "joy": bump(REST[GENERIC.vertex_of("left_mouth_corner")], width_mm=12, along=(1, 1, 2)),
    "anger": bump(REST[GENERIC.vertex_of("nose_root")], width_mm=15, along=(0, -2, 1)),
    "awe": bump(REST[GENERIC.vertex_of("chin")], width_mm=20, along=(0, -3, 0)),
}

EYES = GENERIC.mesh.vertices_of("left_eyeball", "right_eyeball")
_SKIN = np.ones((len(REST), 1))
_SKIN[EYES] = 0


def explained_by(units: Mapping[str, float]) -> Array:
    """(V, 3) mm: the head at rest with these units added."""
    return REST + np.tensordot(weights_of(**units), GENERIC.unit_offsets, axes=1)


def texture(seed: int, size: int = 64) -> Array:
    """(size, size, 3) of random colours."""
    return np.random.default_rng(seed).integers(0, 256, (size, size, 3), np.uint8)


def shapes() -> dict[str, Array]:
    """(V, 3) mm by expression; only anger looks aside."""
    made = {name: explained_by(UNITS[name]) + _SKIN * _BUMPS[name] for name in UNITS}
    made["anger"] = with_turned_eyes(made["anger"], ANGER_GAZE, GENERIC)
    return {"neutral": REST, **made}


def head_of(**changes: object) -> Head:
    """The head with other fields than usual."""
    gaze = {"anger": ANGER_GAZE}
    expressions = {
        name: Expression(
            vertices,
            texture=ATLAS if name == "neutral" else name,
            units=UNITS.get(name, {}),
            gaze=gaze.get(name, np.zeros((2, 2))),
        )
        for name, vertices in shapes().items()
    }
    fields: dict = {
        "subject": "Nobody",
        "mesh": GENERIC.mesh,
        "expressions": expressions,
        "uncertainty_mm": np.ones(len(REST)),
        "unit_names": GENERIC.unit_names,
        "unit_offsets": GENERIC.unit_offsets,
        "textures": {
            name: texture(seed) for seed, name in enumerate((ATLAS, "joy", "anger", "awe"))
        },
    }
    return Head(**(fields | changes))


@cache
def head() -> Head:
    """The head as usual."""
    return head_of()
