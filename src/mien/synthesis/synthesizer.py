"""A person's expressions from feature points: completed, mixed and drawn."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, check_array, frozen
from mien.errors import InputError
from mien.numeric.planar_similarity import PlanarMotion, estimate_planar_motion
from mien.synthesis.composition.composer import Composer
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.head_alignment import compensated
from mien.synthesis.inference.coefficients import (
    DISTANCE_PENALTY,
    apart_from,
    coefficients_of,
    distances_of,
)
from mien.synthesis.inference.conditional import ConditionalMotion
from mien.synthesis.inference.inferred import Inference, check_known
from mien.synthesis.inference.propagation import Propagation

__all__ = [
    "LEAST_TELLING",
    "HeadMotion",
    "PropagationName",
    "Synthesis",
    "SynthesisOptions",
    "Synthesizer",
]

HeadMotion = Literal["told", "still"]
PropagationName = Literal["closed-form", "printed"]

LEAST_TELLING = 3
"""So many points tell how the head moved; two would follow any motion and say nothing else."""

_REMEMBERED = 8


@dataclass(frozen=True)
class SynthesisOptions:
    """What differs from the paper can be switched off, one by one or by `paper`.

    Attributes:
        distance_penalty: as for `coefficients`.
        slack: as for `coefficients`.
        together: as for `coefficients`.
        propagation: how all points come from some: "closed-form" is the one that was measured
            better, "printed" the paper's.

    Raises:
        InputError: another name of a propagation, a penalty or slack that is no number from 0; a
            slack above 1.
    """

    distance_penalty: float = DISTANCE_PENALTY
    slack: float = 0.0
    together: Sequence[Collection[str]] | None = None
    propagation: PropagationName = "closed-form"

    def __post_init__(self) -> None:
        """Check what can be checked without examples."""
        for name in ("distance_penalty", "slack"):
            value = float(check_array(name, getattr(self, name), ()))
            if value < 0:
                raise InputError(name, "a number of 0 or more", value)
        if self.slack > 1:
            raise InputError("slack", "a share, from 0 to 1", self.slack)
        _checked(self.propagation, PropagationName, "propagation")

    @classmethod
    def paper(cls) -> SynthesisOptions:
        """What [Zhang 2006] prints.

        What has no switch stays: teeth of a shut mouth come from all examples, and the printed
        propagation keeps more components (`propagate.COMPONENTS`).
        """
        return cls(distance_penalty=0.0, slack=0.0, together=(), propagation="printed")


@dataclass(frozen=True)
class Synthesis:
    """A picture of an expression, and what it was made from.

    Attributes:
        image: (h, w, 3) sRGB.
        points: (n, 2) px of it.
        coefficients: (R, m) share of each example in each subregion; rows sum to 1.
        hull_px: (R,) root of the mean squared distance of each subregion's points, px of the
            neutral photo, from those of the mix that it was made from. In 99 of 100 frames of d6 at
            most 0.4 px more than `hull_distances`, what no mix at all would reach; but 1.7 for
            brows, which share one mix with the forehead, and 1.1 for teeth, which few examples
            show.
    """

    image: UInt8[Array, "h w 3"]
    points: Float[Array, "n 2"]
    coefficients: Float[Array, "r m"]
    hull_px: Float[Array, " r"]


class Synthesizer:
    """Draws a person's expressions from feature points; made once, used for many pictures.

    Args:
        examples: of the person.
        options: beyond the paper or not.

    Raises:
        InputError: as `Composer`.

    Source:
        [Zhang 2006] sections 6, 7, 10.
    """

    def __init__(self, examples: ExampleSet, options: SynthesisOptions | None = None) -> None:
        self.examples = examples
        self.options = options or SynthesisOptions()
        self._composer = Composer(examples)
        self._inferences: OrderedDict[tuple[bytes, bool], Inference] = OrderedDict()

    def complete(
        self, known: Int[Array, " k"], positions: Float[Array, "k 2"], *, head: HeadMotion = "told"
    ) -> Float[Array, "n 2"]:
        """Where all points are, given where some are.

        The first call for a set of known points takes longer than those that follow.

        Args:
            known: indices of points, none twice.
            positions: (k, 2) px of the neutral photo.
            head: "told": how the head moved is told by the known points, both here and in the
                expressions that are learned from; one or two cannot tell it, and leave the head
                still. "still": it is where the neutral photo has it, as when someone drags points
                there. A few points of a still head must not tell its motion: of three at the mouth
                the others are then 8 px off, where they are 2 px off otherwise (d10). For a moved
                head the opposite is far worse; `plausible.head_moved` tells which.

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
        known, positions = check_known(known, positions, len(neutral))
        if len(known) == len(neutral):
            return positions
        if len(self.examples.statistics) < 2:
            raise InputError("examples", "points of 2 pictures or more to complete others from", 1)
        told = _checked(head, HeadMotion, "head") == "told" and len(known) >= LEAST_TELLING
        motion = estimate_planar_motion(neutral[known], positions) if told else None
        still = positions if motion is None else motion.undo(positions)
        inferred = self._inference(known, told).infer(known, still - neutral[known])
        completed = neutral + inferred.displacements
        if motion is not None:
            completed = motion(completed)
        completed[known] = positions
        return completed

    def head_motion(self, points: Float[Array, "n 2"]) -> PlanarMotion:
        """What the head did from the neutral photo to another; as `Composer.head_motion`."""
        return self._composer.head_motion(points)

    def synthesize(
        self,
        points: Float[Array, "n 2"],
        *,
        motion: PlanarMotion | None = None,
        size: tuple[int, int] | None = None,
        out: UInt8[Array, "h w 3"] | None = None,
    ) -> Synthesis:
        """The picture of an expression, all of whose points are known.

        Args:
            points: (n, 2) px of the picture; they may lie outside.
            motion: of the head, from the neutral photo to the picture; none unless given.
            size: width and height of the picture, px; the neutral photo's unless given.
            out: memory to draw into.

        Raises:
            InputError: shapes, NaN.
            EstimationError: all points in one place.

        Source:
            [Zhang 2006] sections 6 and 7.
        """
        subregions = self.examples.subregions
        apart = apart_from(self.examples, points)
        shares = coefficients_of(
            apart,
            subregions,
            distance_penalty=self.options.distance_penalty,
            slack=self.options.slack,
            together=self.options.together,
            only=self.examples.only,
        )
        image = self._composer.render(points, shares, motion=motion, size=size, out=out)
        missed = distances_of(apart, shares, subregions)
        return Synthesis(image, frozen(np.array(points, float)), frozen(shares), frozen(missed))

    def _inference(self, known: Int[Array, " k"], told: bool) -> Inference:
        """What completes this set of points; the latest few sets are remembered."""
        key = (known.tobytes(), told)
        if key not in self._inferences:
            self._inferences[key] = self._learned(known if told else None)
        self._inferences.move_to_end(key)
        if len(self._inferences) > _REMEMBERED:
            self._inferences.popitem(last=False)
        return self._inferences[key]

    def _learned(self, by: Int[Array, " k"] | None) -> Inference:
        neutral = self.examples.neutral.points
        geometries, _ = compensated(self.examples.statistics, neutral, by=by)
        if self.options.propagation == "printed":
            return Propagation(self.examples.layout, geometries - neutral)
        return ConditionalMotion(geometries - neutral, places=self.examples.layout.template)


def _checked(value: str, choices: object, name: str) -> str:
    names = get_args(choices)
    if value not in names:
        raise InputError(name, " or ".join(names), value)
    return value
