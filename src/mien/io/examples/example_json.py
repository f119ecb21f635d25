"""`examples.json`: everything about examples that is neither pictures nor statistics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mien.arrays import Array, Float
from mien.assets.feature_points import FeatureLayout
from mien.reading.names import is_inside
from mien.reading.strict_json import DocumentFormat, JsonValue
from mien.synthesis.examples.example_set import Example, ExampleSet

EXAMPLES_FORMAT = DocumentFormat("mien examples", 1)
STATISTICS = "statistics.npz"


def photo_file(example: Example) -> str:
    """Path of an example's photo within the folder."""
    return f"photos/{example.name}.png"


def examples_to_json(example_set: ExampleSet, why: Mapping[str, str]) -> dict[str, Any]:
    """The contents of examples.json; why each example was chosen by its name."""
    names = [example.name for example in example_set.examples]
    return {
        **EXAMPLES_FORMAT.header,
        "layout": {
            "name": example_set.layout.name,
            "points": list(example_set.layout.names),
            "pixels": "origin at the top-left corner, centre of the first pixel at (0.5, 0.5)",
        },
        "neutral": names[0],
        "standard": names[example_set.standard],
        "teeth": [names[index] for index in example_set.teeth],
        "statistics": {"file": STATISTICS, "pictures": len(example_set.statistics)},
        "examples": [
            {
                "name": example.name,
                "source": example.source,
                "why": why.get(example.name, ""),
                "photo": photo_file(example),
                "size": [example.photo.shape[1], example.photo.shape[0]],
                "points": {
                    name: [float(x), float(y)]
                    for name, (x, y) in zip(example_set.layout.names, example.points, strict=True)
                },
            }
            for example in example_set.examples
        ],
    }


def check_layout(data: JsonValue, layout: FeatureLayout) -> None:
    """The points must be those of the layout, in its order: coefficients and statistics rely on it.

    Raises:
        DocumentError: other ones.
    """
    name, points = data["name"].text(), data["points"]
    if name == layout.name and points.raw == list(layout.names):
        return
    expected = f"the {len(layout.names)} points of {layout.name}"
    found = f"{len(points.items())} of {name[:40]}" + ", other ones" * (name == layout.name)
    raise data.error(f"expected {expected}, found {found}: run `mien examples` again")


def points_from_json(value: JsonValue, layout: FeatureLayout, side: int) -> Float[Array, "n 2"]:
    """(n, 2) px of points by name.

    Args:
        value: the points in the document.
        layout: of the points.
        side: px, the photo's longer one; a point of a face that it cuts lies within one more.

    Raises:
        DocumentError: one is missing, unknown or no place.
    """
    value.members(layout.names)
    points = np.empty((len(layout.names), 2))
    for index, name in enumerate(layout.names):
        pair = value[name].items()
        if len(pair) != 2:
            raise value[name].error(f"expected [x, y] in px, found {len(pair)} numbers")
        numbers = (JsonValue(item.raw, value[name].place) for item in pair)
        points[index] = [number.number(least=-side, most=2 * side) for number in numbers]
    return points


def photo_from_json(data: JsonValue) -> str:
    """Path of an example's photo within the folder. Raises: DocumentError: one outside of it."""
    if not is_inside(data.text()):
        raise data.error(f"expected a file within the folder, found {data.raw[:60]!r}")
    return data.text()
