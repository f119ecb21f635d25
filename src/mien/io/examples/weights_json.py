"""W.json: how much of which example is in each subregion of a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.io.files.atomic import atomic_file
from mien.reading.strict_json import DocumentFormat
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["WEIGHTS_FORMAT", "save_coefficients", "save_weights"]

WEIGHTS_FORMAT = DocumentFormat("mien weights", 1)
_NEGLIGIBLE = 1e-4
"""A smaller coefficient changes no pixel by more than a fortieth of a grey level."""


def save_weights(
    path: str | Path,
    examples: ExampleSet,
    coefficients: Float[Array, "r m"],
    hull_px: Float[Array, " r"],
) -> None:
    """Write the coefficients of each subregion, largest first, and how far it leaves the hull.

    Args:
        path: the file.
        examples: what the picture was made of.
        coefficients: as `Synthesis` has them.
        hull_px: as `Synthesis` has them.

    Raises:
        InputError: shapes, NaN, the place.
    """
    save_coefficients(
        path,
        layout=examples.layout.name,
        sources={example.name: example.source for example in examples.examples},
        subregions=examples.subregions.names,
        coefficients=coefficients,
        hull={"hull_px": hull_px},
    )


def save_coefficients(
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
        path: the file.
        layout: its name.
        sources: what each example was taken from, by name.
        subregions: their names.
        coefficients: of each example in each subregion.
        hull: how far each subregion leaves the hull, by a key with its unit.

    Raises:
        InputError: shapes, NaN, the place.
    """
    checked = check_array("coefficients", coefficients, (len(subregions), len(sources)))
    rows = zip(subregions, checked, strict=True)
    data = {
        **WEIGHTS_FORMAT.header,
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
    return {names[i]: round(float(row[i]), 6) for i in order if abs(row[i]) >= _NEGLIGIBLE}
