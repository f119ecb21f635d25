"""A head's expressions from feature points in space ([Zhang 2006] section 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mien.arrays import Array, Float, check_array, frozen
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import load_generic_head
from mien.head import Head
from mien.reconstruction.expression.gaze import MAX_GAZE_RAD, yaw_pitch_from_directions
from mien.rig.gaze import SIDES
from mien.rig.rig import Rig
from mien.rig.state import PosedFace
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.skin_interpolation import thin_plate_weights
from mien.synthesis.heads.subregions import head_subregions
from mien.synthesis.inference.coefficients import coefficients_from_offsets, mixture_distances
from mien.synthesis.inference.conditional import ConditionalGaussian
from mien.synthesis.inference.displacement_model import (
    DisplacementModel,
    KnownPoints,
    check_known,
    point_indices,
)
from mien.synthesis.inference.propagation import MotionPropagation
from mien.synthesis.synthesizer import SynthesisOptions

__all__ = ["HeadSynthesis", "HeadSynthesizer"]

MIN_COEFFICIENT = 1e-3
"""Smaller coefficients are set to 0: they change no colour by a quarter of its step."""
_NEAR_MM = 1e-6
_EXPRESSION_DEVIATION, _UNIT_DEVIATION = 0.5, 0.2
"""Standard deviations of the weights of a photographed expression and of a face unit."""
_POINT_NOISE_MM = 0.3
"""Standard deviation of the given points; with less, few points move the others too far."""


@dataclass(frozen=True)
class HeadSynthesis:
    """An expression of a head, and what it was made from.

    Attributes:
        face: shape, and the weights of the expressions' textures at each vertex.
        points: (n, 3) mm, head space, as they were asked for.
        coefficients: (R, K) of the photographed expressions in each subregion; rows sum to 1.
        hull_mm: (R,) root of the mean squared distance of each subregion's points from those of the
            mixture that it was made from.
    """

    face: PosedFace
    points: Float[Array, "n 3"]
    coefficients: Float[Array, "r k"]
    hull_mm: Float[Array, " r"]


class HeadSynthesizer:
    """Makes the expressions of a head from feature points; made once, used for many.

    The photographed expressions are the examples: their shapes give the feature points, their
    shapes and textures are mixed. They lie in head space, so no head motion is compensated.

    Attributes:
        rig: poses and draws the head; its `names` are the examples'.
        layout: of the points.
        subregions: on the mesh.
        examples: (K, n, 3) mm, head space, the points of each expression; neutral first.

    Args:
        head: with the generic head's mesh.
        options: additions to the paper; all that were measured better unless given.
        warp: whether skin and eyes of the mixture are then warped so that they reach the target
            points, as pictures are; the paper leaves them where the mixture has them.
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
        warp: bool = True,
        rig: Rig | None = None,
    ) -> None:
        self.rig = Rig(head) if rig is None else rig
        self.layout, self.subregions = load_feature_layout(), head_subregions()
        self._options, self._warp = options or SynthesisOptions(), warp
        shapes = np.stack([head.expressions[name].vertices for name in self.rig.names])
        self.examples = frozen(feature_points_on(shapes))
        self._units = feature_points_on(head.units)
        self._model: DisplacementModel | None = None

    def complete(
        self, known: KnownPoints, positions: ArrayLike | None = None
    ) -> Float[Array, "n 3"]:
        """Where all points are, given where some are.

        Their statistics come from the photographed expressions and the head's face units, each
        taken to any degree, independently of the others.

        Args:
            known: positions by the points' names, mm, head space; or (k,) names or indices of
                points, none twice, with `positions` beside.
            positions: (k, 3) mm, head space.

        Returns:
            (n, 3) mm; the known points exactly where they were given.

        Raises:
            InputError: no points, unknown or repeated ones, shapes, NaN.

        Source:
            [Zhang 2006] section 10.
        """
        neutral = self.examples[0]
        indices, places = point_indices(self.layout, known, positions)
        subset, given = check_known(indices, places, *neutral.shape)
        if self._model is None:
            self._model = self._fitted_model()
        inferred = self._model.infer(subset, given - neutral[subset])
        completed: Array = neutral + inferred.displacements
        completed[subset] = given
        return completed

    def synthesize(self, points: Float[Array, "n 3"]) -> HeadSynthesis:
        """The expression with these points, as near as the head's own expressions come to it.

        Args:
            points: (n, 3) mm, head space, all that the layout has.

        Raises:
            InputError: shape, NaN.

        Source:
            [Zhang 2006] sections 6, 7, 9: vertices and colours are mixed alike.
        """
        points = check_array("points", points, (len(self.layout.names), 3))
        offsets, options = self.examples - points, self._options
        coefficients = coefficients_from_offsets(
            offsets,
            self.subregions,
            distance_penalty=options.distance_penalty,
            slack=options.slack,
            tied=options.tied or (),
        )
        coefficients = _without_small(coefficients)
        # In this order, equal rows give exactly equal weights also where subregions blend.
        weights = coefficients[0] + self.subregions.fades @ (coefficients - coefficients[0])
        hull_mm = mixture_distances(offsets, coefficients, self.subregions)
        face = self._mixed(weights, points)
        return HeadSynthesis(face, frozen(points), frozen(coefficients), frozen(hull_mm))

    def _mixed(self, weights: Float[Array, "v k"], points: Float[Array, "n 3"]) -> PosedFace:
        if not self._warp:
            return self.rig.mixed(weights)
        mixed = self.rig.mixed(weights, contacts=False)
        residual = points - feature_points_on(mixed.vertices)
        if np.abs(residual).max() < _NEAR_MM:
            return self.rig.mixed(weights)
        turn = self._eye_rotation(mixed.vertices, points)
        return self.rig.mixed(weights, thin_plate_weights() @ residual, turn=turn)

    def _eye_rotation(
        self, vertices: Float[Array, "v 3"], points: Float[Array, "n 3"]
    ) -> Float[Array, "2 2"]:
        """(2, 2) rad, yaw and pitch by which each eye rotates to bring its pupil to its point."""
        balls = [load_generic_head().mesh.vertices_of(f"{side}_eyeball") for side in SIDES]
        centres = np.array([vertices[ball].mean(axis=0) for ball in balls])
        pupils = [self.layout.index(f"{side}_pupil") for side in SIDES]
        directions = np.stack([points[pupils], feature_points_on(vertices)[pupils]]) - centres
        directions /= np.linalg.norm(directions, axis=2, keepdims=True)
        target, current = map(yaw_pitch_from_directions, directions)
        return np.clip(target - current, -MAX_GAZE_RAD, MAX_GAZE_RAD)

    def _fitted_model(self) -> DisplacementModel:
        expressions = self.examples[1:] - self.examples[0]
        rows = np.concatenate([_EXPRESSION_DEVIATION * expressions, _UNIT_DEVIATION * self._units])
        # Rows and their negatives, scaled so that the covariance is the sum of the rows' products:
        # each weight varies by its standard deviation, independently of the others.
        rows *= np.sqrt(len(rows))
        statistics = np.concatenate([rows, -rows])
        if self._options.propagation == "printed":
            return MotionPropagation(self.layout, statistics)
        return ConditionalGaussian(
            statistics,
            components=len(rows),
            min_noise=_POINT_NOISE_MM,
            template=self.layout.template,
        )


def _without_small(coefficients: Float[Array, "r k"]) -> Float[Array, "r k"]:
    """Coefficients that still sum to 1; what the small ones had goes to the largest."""
    kept = np.where(np.abs(coefficients) < MIN_COEFFICIENT, 0.0, coefficients)
    largest = kept.argmax(axis=1)[:, None]
    others = kept.copy()
    np.put_along_axis(others, largest, 0.0, axis=1)
    np.put_along_axis(kept, largest, 1 - others.sum(axis=1, keepdims=True), axis=1)
    return kept
