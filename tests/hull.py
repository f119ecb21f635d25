"""Distance of a face from the convex hull of the examples: the reference for synthesis."""

from __future__ import annotations

from mien.arrays import Array, Float
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.inference.coefficients import (
    coefficients_from_offsets,
    example_offsets,
    mixture_distances,
)


def hull_distances(example_set: ExampleSet, points: Float[Array, "n 2"]) -> Float[Array, " R"]:
    """Root of the mean squared distance of each subregion's points, px of the neutral photo."""
    offsets, subregions = example_offsets(example_set, points), example_set.subregions
    nearest = coefficients_from_offsets(offsets, subregions, distance_penalty=0.0, tied=())
    return mixture_distances(offsets, nearest, subregions)
