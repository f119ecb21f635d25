"""W.json: which examples made which subregion of a picture, and in which share."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.io.files.atomic import atomic_file
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["FORMAT", "VERSION", "save_shares", "save_weights"]

FORMAT, VERSION = "mien weights", 1
_LEAST = 1e-4
"""A smaller share changes no pixel by more than a fortieth of a grey level."""


def save_weights(
    path: str | Path,
    examples: ExampleSet,
    coefficients: Float[Array, "r m"],
    hull_px: Float[Array, " r"],
) -> None:
    """Writes the shares of each subregion, the greatest first, and how far it leaves the hull.

    Args:
        coefficients: as `Synthesis` has them.
        hull_px: as `Synthesis` has them.

    Raises:
        InputError: shapes, NaN, the place.
    """
    save_shares(
        path,
        layout=examples.layout.name,
        sources={example.name: example.source for example in examples.examples},
        subregions=examples.subregions.names,
        coefficients=coefficients,
        hull={"hull_px": hull_px},
    )


def save_shares(
    path: str | Path,
    *,
    layout: str,
    sources: Mapping[str, str],
    subregions: Sequence[str],
    coefficients: Float[Array, "r m"],
    hull: Mapping[str, Float[Array, " r"]],
) -> None:
    """The same of examples of any kind.

    Args:
        layout: its name.
        sources: what each example was taken from, by name.
        subregions: their names.
        coefficients: share of each example in each subregion.
        hull: how far each subregion leaves the hull, by a key that says in which unit.

    Raises:
        InputError: shapes, NaN, the place.
    """
    shares = check_array("coefficients", coefficients, (len(subregions), len(sources)))
    rows = zip(subregions, shares, strict=True)
    data = {
        "format": FORMAT,
        "version": VERSION,
        "generator": f"mien {version('mien')}",
        "layout": layout,
        "examples": [{"name": name, "source": source} for name, source in sources.items()],
        "subregions": {name: _by_example(tuple(sources), row) for name, row in rows},
    }
    for key, values in hull.items():
        distances = check_array(key, values, (len(subregions),)).tolist()
        pairs = zip(subregions, distances, strict=True)
        data[key] = {name: round(distance, 3) for name, distance in pairs}
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def _by_example(names: Sequence[str], row: Float[Array, " m"]) -> dict[str, float]:
    order = np.argsort(-np.abs(row), kind="stable")
    return {names[i]: round(float(row[i]), 6) for i in order if abs(row[i]) >= _LEAST}
