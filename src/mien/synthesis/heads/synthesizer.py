"""A head's expressions from feature points in space ([Zhang 2006] section 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int, check_array, frozen
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import load_generic_head
from mien.head import Head
from mien.reconstruction.expression.gaze import MOST_RAD, yaw_pitch_of
from mien.rig.followers import part_vertices
from mien.rig.gaze import SIDES
from mien.rig.rig import Rig
from mien.rig.state import PosedFace
from mien.synthesis.heads.points import feature_points_on, skin_with_points
from mien.synthesis.heads.subregions import head_subregions
from mien.synthesis.inference.coefficients import coefficients_of, distances_of
from mien.synthesis.inference.conditional import ConditionalMotion
from mien.synthesis.inference.inferred import Inference, check_known
from mien.synthesis.inference.propagation import Propagation
from mien.synthesis.synthesizer import SynthesisOptions

__all__ = ["HeadSynthesis", "HeadSynthesizer"]

LEAST_SHARE = 1e-3
"""Smaller shares of an example are none: they change no colour by a quarter of its step."""
_NEAR_MM = 1e-6
_EXPRESSION, _UNIT = 0.5, 0.2
"""How far an expression and a unit are usually made, of the whole of it."""
_SURE_MM = 0.3
"""How well a point that is given is known: with more trust few points tell too much."""


@dataclass(frozen=True)
class HeadSynthesis:
    """An expression of a head, and what it was made from.

    Attributes:
        face: shape, and whose texture shows how much where.
        points: (n, 3) mm, head space, as they were asked for.
        coefficients: (R, K) share of each photographed expression in each subregion.
        hull_mm: (R,) root of the mean squared distance of each subregion's points from those of the
            mix that it was made from.
    """

    face: PosedFace
    points: Float[Array, "n 3"]
    coefficients: Float[Array, "r k"]
    hull_mm: Float[Array, " r"]


class HeadSynthesizer:
    """Makes the expressions of a head from feature points; made once, used for many.

    The photographed expressions are the examples: their shapes give the feature points, their
    shapes and textures are mixed. They lie in the head's own space, so no motion has to be undone.

    Attributes:
        rig: poses and draws the head; its `names` are the examples'.
        layout: what points there are. subregions: on the mesh.
        examples: (K, n, 3) mm, head space, the points of each expression; neutral first.

    Args:
        head: with the generic head's mesh.
        options: beyond the paper or not.
        reach: whether skin and eyes are moved on to where the points were asked for, as pictures
            are warped; the paper leaves them where the mix of examples has them.
        rig: of the head, if there is one already.

    Raises:
        InputError: as `Rig`.

    Source:
        [Zhang 2006] sections 6, 7, 9, 10.
    """

    def __init__(
        self,
        head: Head,
        options: SynthesisOptions | None = None,
        *,
        reach: bool = True,
        rig: Rig | None = None,
    ) -> None:
        self.rig = Rig(head) if rig is None else rig
        self.layout, self.subregions = load_feature_layout(), head_subregions()
        self._options, self._reach = options or SynthesisOptions(), reach
        shapes = np.stack([head.expressions[name].vertices for name in self.rig.names])
        self.examples = frozen(feature_points_on(shapes))
        self._units = feature_points_on(head.units)
        self._inference: Inference | None = None

    def complete(
        self, known: Int[Array, " k"], positions: Float[Array, "k 3"]
    ) -> Float[Array, "n 3"]:
        """Where all points are, given where some are.

        What is usual for them comes from the photographed expressions and the head's face units:
        each of them made to any degree, independently of the others.

        Args:
            known: indices of points, none twice.
            positions: (k, 3) mm, head space.

        Returns:
            (n, 3) mm; the known points exactly where they were given.

        Raises:
            InputError: no points, unknown or repeated ones, shapes, NaN.

        Source:
            [Zhang 2006] section 10.
        """
        neutral = self.examples[0]
        known, positions = check_known(known, positions, *neutral.shape)
        if self._inference is None:
            self._inference = self._learned()
        inferred = self._inference.infer(known, positions - neutral[known])
        completed: Array = neutral + inferred.displacements
        completed[known] = positions
        return completed

    def synthesize(self, points: Float[Array, "n 3"]) -> HeadSynthesis:
        """The expression whose points these are, as near as the head's own come to it.

        Args:
            points: (n, 3) mm, head space, all that the layout has.

        Raises:
            InputError: shape, NaN.

        Source:
            [Zhang 2006] sections 6, 7, 9: vertices and colours are mixed alike.
        """
        points = check_array("points", points, (len(self.layout.names), 3))
        apart, options = self.examples - points, self._options
        shares = coefficients_of(
            apart,
            self.subregions,
            distance_penalty=options.distance_penalty,
            slack=options.slack,
            together=options.together or (),
        )
        shares = _without_small(shares)
        # In this order, subregions that agree leave no trace of their borders.
        weights = shares[0] + self.subregions.fades @ (shares - shares[0])
        missed = distances_of(apart, shares, self.subregions)
        face = self._mixed(weights, points)
        return HeadSynthesis(face, frozen(points), frozen(shares), frozen(missed))

    def _mixed(self, weights: Float[Array, "v k"], points: Float[Array, "n 3"]) -> PosedFace:
        if not self._reach:
            return self.rig.mixed(weights)
        mixed = self.rig.mixed(weights, contacts=False)
        missing = points - feature_points_on(mixed.vertices)
        if np.abs(missing).max() < _NEAR_MM:
            return self.rig.mixed(weights)
        turn = self._turn(mixed.vertices, points)
        return self.rig.mixed(weights, skin_with_points() @ missing, turn=turn)

    def _turn(
        self, vertices: Float[Array, "v 3"], points: Float[Array, "n 3"]
    ) -> Float[Array, "2 2"]:
        """(2, 2) rad, how the eyes of a face turn on until the pupils are where points say."""
        balls = [part_vertices(load_generic_head(), f"{side}_eyeball") for side in SIDES]
        centres = np.array([vertices[ball].mean(axis=0) for ball in balls])
        pupils = [self.layout.index(f"{side}_pupil") for side in SIDES]
        towards = np.stack([points[pupils], feature_points_on(vertices)[pupils]]) - centres
        towards /= np.linalg.norm(towards, axis=2, keepdims=True)
        wanted, found = map(yaw_pitch_of, towards)
        return np.clip(wanted - found, -MOST_RAD, MOST_RAD)

    def _learned(self) -> Inference:
        expressions = self.examples[1:] - self.examples[0]
        moves = np.concatenate([_EXPRESSION * expressions, _UNIT * self._units])
        # As many rows as ways to move, and as many again the other way: each spreads as it usually
        # does, independently of the others.
        moves *= np.sqrt(len(moves))
        statistics = np.concatenate([moves, -moves])
        if self._options.propagation == "printed":
            return Propagation(self.layout, statistics)
        return ConditionalMotion(
            statistics,
            components=len(moves),
            least_noise=_SURE_MM,
            places=self.layout.template,
        )


def _without_small(shares: Float[Array, "r k"]) -> Float[Array, "r k"]:
    """Shares that still sum to 1; what the small ones had goes to the largest."""
    kept = np.where(np.abs(shares) < LEAST_SHARE, 0.0, shares)
    largest = kept.argmax(axis=1)[:, None]
    others = kept.copy()
    np.put_along_axis(others, largest, 0.0, axis=1)
    np.put_along_axis(kept, largest, 1 - others.sum(axis=1, keepdims=True), axis=1)
    return kept
