"""JSON files of what is drawn on a face; every error names the file and the place in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from mien.reading.strict_json import DocumentFormat, JsonValue, errors_name_file, read_json

_VERSION = 1
_MAX_WEIGHT = 1e6

_Kind = TypeVar("_Kind")


def read_data(path: Path, format_name: str, build: Callable[[JsonValue], _Kind]) -> _Kind:
    """What `build` makes of the document in a file of this format.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: not such a file; names the place.
    """
    document = JsonValue(read_json(path))
    with errors_name_file(path):
        DocumentFormat(format_name, _VERSION).check(document)
        return build(document)


def affine_weights(shares: JsonValue, index: Callable[[str], int | None]) -> dict[int, float]:
    """Weights that sum to 1, by the index of the point that each name stands for.

    Raises:
        DocumentError: an unknown name, no numbers, another sum.
    """
    weights: dict[int, float] = {}
    for name, weight in shares.members().items():
        number = index(name)
        if number is None:
            raise shares.error(f"unknown point {name[:40]!r}")
        # A weight may lie outside of [0, 1].
        weight = JsonValue(weight.raw, shares.place)
        weights[number] = weight.number(least=-_MAX_WEIGHT, most=_MAX_WEIGHT)
    if not abs(sum(weights.values()) - 1) < 1e-6:
        total = sum(weights.values())
        raise shares.error(f"expected shares that sum to 1, found {total:g}")
    return weights
