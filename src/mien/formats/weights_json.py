"""W.json: which examples made which subregion of a picture, and in which share."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.formats.atomic import atomic_file
from mien.synthesis.examples import ExampleSet

__all__ = ["FORMAT", "VERSION", "write_weights"]

FORMAT, VERSION = "mien weights", 1
_LEAST = 1e-4
"""A smaller share changes no pixel by more than a fortieth of a grey level."""


def write_weights(
    path: str | Path,
    examples: ExampleSet,
    coefficients: Float[Array, "r m"],
    hull_px: Float[Array, " r"],
) -> None:
    """Writes the shares of each subregion, the greatest first, and how far it leaves the hull.

    Args:
        coefficients, hull_px: as `Synthesis` has them.
    Raises: InputError: shapes, NaN, the place.
    """
    names = examples.subregions.names
    shape = (len(names), len(examples.examples))
    shares = check_array("coefficients", coefficients, shape)
    distances = check_array("hull_px", hull_px, (len(names),))
    data = {
        "format": FORMAT,
        "version": VERSION,
        "generator": f"mien {version('mien')}",
        "layout": examples.layout.name,
        "examples": [{"name": e.name, "source": e.source} for e in examples.examples],
        "subregions": {
            name: _by_example(examples, row) for name, row in zip(names, shares, strict=True)
        },
        "hull_px": {name: round(float(px), 3) for name, px in zip(names, distances, strict=True)},
    }
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def _by_example(examples: ExampleSet, row: Float[Array, " m"]) -> dict[str, Any]:
    order = np.argsort(-np.abs(row), kind="stable")
    return {
        examples.examples[i].name: round(float(row[i]), 6) for i in order if abs(row[i]) >= _LEAST
    }
