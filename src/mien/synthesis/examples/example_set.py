"""The examples that a person's expressions are mixed from: photos and their feature points."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float, UInt8, check_array, check_image, frozen
from mien.assets.feature_points import FeatureLayout
from mien.assets.subregions import Subregions
from mien.errors import InputError
from mien.synthesis.examples.head_alignment import align_to_neutral

__all__ = ["Example", "ExampleSet"]


@dataclass(frozen=True)
class Example:
    """One expression of a person: E_i = (G_i, I_i).

    Attributes:
        name: of the example, unique in a set.
        photo: (h, w, 3) sRGB.
        points: (n, 2) px of the photo; may lie outside of it.
        source: the file or the frame that it was taken from.

    Raises:
        InputError: not an image; shape of the points, NaN.

    Source:
        [Zhang 2006] section 3.
    """

    name: str
    photo: UInt8[Array, "h w 3"]
    points: Float[Array, "n 2"]
    source: str

    def __post_init__(self) -> None:
        """Check and protect the arrays."""
        check_image(f"photo of {self.name}", self.photo)
        points = check_array(f"points of {self.name}", self.points, (None, 2))
        object.__setattr__(self, "points", frozen(points))


@dataclass(frozen=True)
class ExampleSet:
    """A person's examples, and statistics of the points in more of their expressions.

    Attributes:
        layout: of the points.
        examples: neutral first.
        standard: the example in whose picture, mouth open, the subregions are drawn.
        statistics: (N, n, 2) geometries, px of the neutral photo, that points are inferred from;
            of more pictures than the examples.
        subregions: over the standard example's photo.
        teeth: indices of the examples that show teeth, from which those are made; all if empty.

    Raises:
        InputError: no example, two of one name, points of another layout, no such `standard` or
            teeth, subregions that are drawn over a picture of another size or another layout.

    Source:
        [Zhang 2006] sections 5 and 8.
    """

    layout: FeatureLayout
    examples: tuple[Example, ...]
    standard: int
    statistics: Float[Array, "N n 2"]
    subregions: Subregions
    teeth: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check that all parts have the same points."""
        count = len(self.layout.names)
        if not self.examples:
            raise InputError("examples", "at least one, the neutral face", "none")
        for example in self.examples:
            check_array(f"points of {example.name}", example.points, (count, 2))
        names = Counter(example.name for example in self.examples)
        twice = [name for name, times in names.items() if times > 1]
        if twice:
            raise InputError("examples", "names of their own", f"{twice[0]!r} twice")
        for name, row in (("standard", self.standard), *(("teeth", row) for row in self.teeth)):
            if not 0 <= row < len(self.examples):
                raise InputError(name, f"the index of one of {len(self.examples)} examples", row)
        size = self.examples[self.standard].photo.shape[:2]
        check_array("fades", self.subregions.fades, (*size, None), dtype=np.float32)
        for name, members in zip(self.subregions.names, self.subregions.members, strict=True):
            if members.max() >= count:
                raise InputError(
                    f"members of {name}", f"points from 0 to {count - 1}", members.max()
                )
        statistics = check_array("statistics", self.statistics, (None, count, 2))
        object.__setattr__(self, "statistics", frozen(statistics))

    @property
    def neutral(self) -> Example:
        """The face at rest; geometries are in px of its photo."""
        return self.examples[0]

    @property
    def subsets(self) -> dict[str, tuple[int, ...]]:
        """By subregion, the examples that it is made from; all where there is no entry.

        Source:
            [Zhang 2006] section 8.
        """
        return {"teeth": self.teeth}

    @cached_property
    def geometries(self) -> Float[Array, "m n 2"]:
        """(m, n, 2) points of the examples, head motion compensated, px of the neutral photo."""
        points = np.stack([example.points for example in self.examples])
        return frozen(self.geometry(points))

    def geometry(self, points: Float[Array, "*batch n 2"]) -> Float[Array, "*batch n 2"]:
        """Points with the head's motion since the neutral photo compensated.

        Args:
            points: (..., n, 2) px of one photo each.

        Returns:
            (..., n, 2) px of the neutral photo.

        Raises:
            InputError: shape, NaN.
            EstimationError: all points in one place.

        Source:
            [Zhang 2006] section 12, eq. (8), (9).
        """
        geometries, _ = align_to_neutral(points, self.neutral.points)
        return geometries
