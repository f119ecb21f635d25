"""A person's expressions from feature points: completed, mixed and drawn."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from mien.arrays import Array, Float, Int, UInt8, check_array, frozen
from mien.errors import InputError
from mien.numeric.planar_similarity import PlanarSimilarity, estimate_planar_similarity
from mien.synthesis.composition.composer import Composer
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.head_alignment import align_to_neutral
from mien.synthesis.inference.coefficients import (
    DISTANCE_PENALTY,
    coefficients_from_offsets,
    example_offsets,
    mixture_distances,
)
from mien.synthesis.inference.conditional import ConditionalGaussian
from mien.synthesis.inference.displacement_model import (
    DisplacementModel,
    KnownPoints,
    check_known,
    point_indices,
)
from mien.synthesis.inference.propagation import MotionPropagation

__all__ = [
    "MIN_MOTION_POINTS",
    "HeadMotionMode",
    "PropagationMethod",
    "Synthesis",
    "SynthesisOptions",
    "Synthesizer",
]

HeadMotionMode = Literal["estimated", "still"]
PropagationMethod = Literal["closed-form", "printed"]

MIN_MOTION_POINTS = 3
"""So many points determine the head's motion; a similarity fits any two exactly."""

_CACHE_SIZE = 8


@dataclass(frozen=True)
class SynthesisOptions:
    """What differs from the paper can be switched off, one by one or by `paper`.

    Attributes:
        distance_penalty: as for `coefficients`.
        slack: as for `coefficients`.
        tied: as for `coefficients`.
        propagation: how all points are inferred from some: "closed-form" is the one that was
            measured better, "printed" the paper's.

    Raises:
        InputError: another name of a propagation, a penalty or slack that is no number from 0; a
            slack above 1.
    """

    distance_penalty: float = DISTANCE_PENALTY
    slack: float = 0.0
    tied: Sequence[Collection[str]] | None = None
    propagation: PropagationMethod = "closed-form"

    def __post_init__(self) -> None:
        for name in ("distance_penalty", "slack"):
            value = float(check_array(name, getattr(self, name), ()))
            if value < 0:
                raise InputError(name, "a number of 0 or more", value)
        if self.slack > 1:
            raise InputError("slack", "a share, from 0 to 1", self.slack)
        _check_choice("propagation", self.propagation, PropagationMethod)

    @classmethod
    def paper(cls) -> SynthesisOptions:
        """What [Zhang 2006] prints.

        What has no switch stays: teeth of a shut mouth come from all examples, and the printed
        propagation keeps more components (`propagation.COMPONENTS`).
        """
        return cls(distance_penalty=0.0, slack=0.0, tied=(), propagation="printed")


@dataclass(frozen=True)
class Synthesis:
    """A picture of an expression, and what it was made from.

    Attributes:
        image: (h, w, 3) sRGB.
        points: (n, 2) px of it.
        coefficients: (R, m) of the examples in each subregion; rows sum to 1.
        hull_px: (R,) root of the mean squared distance of each subregion's points, px of the
            neutral photo, from those of the mixture that it was made from. In 99 of 100 frames of
            d6 at most 0.4 px more than the distance from the convex hull of the examples; but 1.7
            for brows, which are tied to the forehead, and 1.1 for teeth, which few examples show.
    """

    image: UInt8[Array, "h w 3"]
    points: Float[Array, "n 2"]
    coefficients: Float[Array, "r m"]
    hull_px: Float[Array, " r"]


class Synthesizer:
    """Draws a person's expressions from feature points; made once, used for many pictures.

    Args:
        examples: of the person.
        options: additions to the paper; all that were measured better unless given.

    Raises:
        InputError: as `Composer`.

    Source:
        [Zhang 2006] sections 6, 7, 10.
    """

    def __init__(self, examples: ExampleSet, options: SynthesisOptions | None = None) -> None:
        self.examples = examples
        self.options = options or SynthesisOptions()
        self._composer = Composer(examples)
        self._models: OrderedDict[tuple[bytes, bool], DisplacementModel] = OrderedDict()

    def complete(
        self,
        known: KnownPoints,
        positions: ArrayLike | None = None,
        *,
        head: HeadMotionMode = "estimated",
    ) -> Float[Array, "n 2"]:
        """Where all points are, given where some are.

        The first call for a set of known points takes longer than those that follow.

        Args:
            known: positions by the points' names, px of the neutral photo; or (k,) names or indices
                of points, none twice, with `positions` beside.
            positions: (k, 2) px of the neutral photo.
            head: "estimated": the head's motion is estimated from the known points, both here and
                in the expressions that are learned from; from one or two it cannot be, and the head
                is taken to be still. "still": it is where the neutral photo has it, as when someone
                drags points there. A few points of a still head must not be used to estimate its
                motion: of three at the mouth the others are then 8 px off, where they are 2 px off
                otherwise (d10). For a moved head the opposite is far worse;
                `input_checks.head_moved` decides which is likelier.

        Returns:
            (n, 2) px of the neutral photo; the known points exactly where they were given.

        Raises:
            InputError: no points, unknown or repeated ones, shapes, NaN, fewer than two expressions
                to learn from.
            EstimationError: all points in one place.

        Source:
            [Zhang 2006] sections 10 and 12.
        """
        neutral = self.examples.neutral.points
        indices, places = point_indices(self.examples.layout, known, positions)
        subset, given = check_known(indices, places, len(neutral))
        if len(subset) == len(neutral):
            return given
        if len(self.examples.statistics) < 2:
            raise InputError("examples", "points of 2 pictures or more to complete others from", 1)
        _check_choice("head", head, HeadMotionMode)
        estimated = head == "estimated" and len(subset) >= MIN_MOTION_POINTS
        motion = estimate_planar_similarity(neutral[subset], given) if estimated else None
        aligned = given if motion is None else motion.inverse(given)
        inferred = self._model(subset, estimated).infer(subset, aligned - neutral[subset])
        completed = neutral + inferred.displacements
        if motion is not None:
            completed = motion(completed)
        completed[subset] = given
        return completed

    def head_motion(self, points: Float[Array, "n 2"]) -> PlanarSimilarity:
        """The head's motion from the neutral photo to another one.

        Args:
            points: (n, 2) px of the other photo.

        Returns:
            a similarity, from px of the neutral photo to px of the other.

        Raises:
            InputError: shape, NaN.
            EstimationError: rigid points in one place.
        """
        return self._composer.head_motion(points)

    def synthesize(
        self,
        points: Float[Array, "n 2"],
        *,
        motion: PlanarSimilarity | None = None,
        size: tuple[int, int] | None = None,
        out: UInt8[Array, "h w 3"] | None = None,
    ) -> Synthesis:
        """The picture of an expression, all of whose points are known.

        Args:
            points: (n, 2) px of the picture; they may lie outside.
            motion: of the head, from the neutral photo to the picture; none unless given.
            size: width and height of the picture, px; the neutral photo's unless given.
            out: (h, w, 3) image to draw into; a new one unless given.

        Raises:
            InputError: shapes, NaN.
            EstimationError: all points in one place.

        Source:
            [Zhang 2006] sections 6 and 7.
        """
        subregions = self.examples.subregions
        offsets = example_offsets(self.examples, points)
        coefficients = coefficients_from_offsets(
            offsets,
            subregions,
            distance_penalty=self.options.distance_penalty,
            slack=self.options.slack,
            tied=self.options.tied,
            subsets=self.examples.subsets,
        )
        image = self._composer.render(points, coefficients, motion=motion, size=size, out=out)
        hull_px = mixture_distances(offsets, coefficients, subregions)
        return Synthesis(
            image, frozen(np.array(points, float)), frozen(coefficients), frozen(hull_px)
        )

    def _model(self, known: Int[Array, " k"], estimated: bool) -> DisplacementModel:
        """The model for these known points; those of the latest few sets are cached."""
        key = (known.tobytes(), estimated)
        if key not in self._models:
            self._models[key] = self._fitted_model(known if estimated else None)
        self._models.move_to_end(key)
        if len(self._models) > _CACHE_SIZE:
            self._models.popitem(last=False)
        return self._models[key]

    def _fitted_model(self, subset: Int[Array, " k"] | None) -> DisplacementModel:
        neutral = self.examples.neutral.points
        geometries, _ = align_to_neutral(self.examples.statistics, neutral, subset=subset)
        if self.options.propagation == "printed":
            return MotionPropagation(self.examples.layout, geometries - neutral)
        return ConditionalGaussian(geometries - neutral, template=self.examples.layout.template)


def _check_choice(name: str, value: str, choices: object) -> None:
    names = get_args(choices)
    if value not in names:
        raise InputError(name, " or ".join(names), value)
