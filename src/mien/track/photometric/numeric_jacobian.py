"""The Jacobian by central differences of the drawn picture, [Pighin 2002]'s other way.

It includes what the analytic Jacobian leaves out: occlusion, the effect of a moving outline on the
filter and, on request, contacts and shadows. It takes two more drawings for every unknown
(docs/notes/tracking-experiments.md compares both).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.errors import InputError
from mien.track.face_model import FaceModel
from mien.track.image.drawing import Drawing
from mien.track.parameters import Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, image_jacobian, vertex_jacobian
from mien.track.photometric.linearization import (
    ImagePair,
    Linearization,
    Linearizer,
    PyramidLevel,
    band_passed,
)
from mien.track.photometric.normal_equations import NormalEquations, accumulate_normal_equations
from mien.track.photometric.samples import ParameterSupport, Warp, take_samples
from mien.track.state import Layout

STEP_PX = 0.5
"""How far a step moves the fastest part of the face."""
_MAX_STEP = 0.1
"""Step in a parameter of the face that moves almost nothing."""


def numeric_linearizer(
    numeric: Bool[Array, " n"],
    *,
    plain: bool = False,
    exact: bool = False,
    step_px: float = STEP_PX,
) -> Linearizer:
    """Linearizes in pose and face, some columns by central differences, the others analytic.

    Args:
        numeric: (N,) whose columns are by differences; any, all or none.
        plain: compare plain pictures; otherwise band-pass filtered ones.
        exact: draw the rig's own face every time, with contacts and shadows, not the face that is
            linear around the level's anchor.
        step_px: how far a step moves the fastest part of the face.

    Source:
        [Pighin 2002] sec. 6.1.3, except that the residual is differentiated, not the drawn picture
        alone: the filter takes means over the face, so the filtered target changes with it.
    """

    def linearized(level: PyramidLevel, parameters: Parameters) -> Linearization:
        return _NumericLinearization(
            level, parameters, np.flatnonzero(numeric), plain, exact, step_px
        )

    return linearized


@dataclass(frozen=True)
class _NumericLinearization:
    """A Linearization that draws the face at every parameters. Fields as numeric_linearizer."""

    level: PyramidLevel
    parameters: Parameters
    numeric: Int[Array, " m"]
    plain: bool
    exact: bool
    step_px: float

    def normal_equations(self, parameters: Parameters) -> NormalEquations:
        level = self._around(parameters)
        drawing = level.draw(parameters, layers=True)
        layers, drawn, target = _compared(level, drawing, self.plain)
        jacobian = image_jacobian(
            level.model.offsets, drawing.positions, parameters.pose, level.crop
        )
        steps = _steps(level.model, vertex_jacobian(jacobian, drawing.positions), self.step_px)
        changes = [self._change(parameters, int(n), steps[n]) for n in self.numeric]
        # A change of the picture, pixel by pixel, enters as one more layer of the mixture.
        layers = np.dstack([layers, *changes]) if changes else layers
        jacobian.active[self.numeric] = 0
        support = _support_with_layers(level.model.support, self.numeric)
        compared = (layers, drawn, target, level.weights)
        samples = take_samples(drawing, *compared, support, jacobian.intrinsics, scale=level.scale)
        warp = Warp(np.eye(3), np.zeros(3), jacobian.intrinsics, np.zeros(len(jacobian.active)))
        return accumulate_normal_equations(samples, warp, jacobian, support)

    def image_pair(self, parameters: Parameters) -> ImagePair:
        return self._around(parameters).image_pair(parameters)

    def _around(self, parameters: Parameters) -> PyramidLevel:
        if not self.exact:
            return self.level
        return replace(self.level, anchor=self.level.model.anchored(parameters.face))

    def _change(self, parameters: Parameters, unknown: int, step: float) -> Float[Array, "h w"]:
        """Minus the residual's derivative; 0 where not both steps show the face."""
        ahead = np.zeros(POSE_UNKNOWNS + len(parameters.face.vector))
        ahead[unknown] = step
        residuals, shown = [], []
        for moved in (parameters.plus(ahead), parameters.plus(-ahead)):
            around = self._around(moved)
            drawing = around.draw(moved, layers=False)
            _, drawn, target = _compared(around, drawing, self.plain)
            residuals.append(target - drawn)
            shown.append(drawing.mask > 0)
        change = (residuals[1] - residuals[0]) / np.float32(2 * step)
        return np.where(shown[0] & shown[1], change, np.float32(0))


def select_unknowns(layout: Layout, names: Sequence[str]) -> Bool[Array, " n"]:
    """(N,) the unknowns of these names: `pose`, a region, a unit, `gaze`.

    Raises:
        InputError: another name.
    """
    directions = len(layout.expressions) - 1
    counts = {"pose": POSE_UNKNOWNS} | dict.fromkeys(layout.regions, directions)
    counts |= dict.fromkeys(layout.units, 1) | {"gaze": 2}
    for name in names:
        if name not in counts:
            raise InputError("numeric", f"some of {', '.join(counts)}", name)
    return np.repeat([name in names for name in counts], list(counts.values()))


def _compared(
    level: PyramidLevel, drawing: Drawing, plain: bool
) -> tuple[Float[Array, "h w k"], Float[Array, "h w"], Float[Array, "h w"]]:
    """Layers, their mixture and the target as they are compared."""
    if plain:
        return drawing.layers, drawing.luma, level.target
    return band_passed(level, drawing)


def _steps(model: FaceModel, jacobian: Float[Array, "v n 2"], step_px: float) -> Float[Array, " n"]:
    """(N,) that move the fastest vertex by so many px; at most _MAX_STEP in the face's unknowns."""
    outline = np.unique(model.painted.triangles[model.compared])
    fastest = np.linalg.norm(jacobian[outline], axis=2).max(axis=0)
    longest = np.full(len(fastest), _MAX_STEP)
    longest[:POSE_UNKNOWNS] = np.inf
    return np.minimum(step_px / np.maximum(fastest, 1e-9), longest)


def _support_with_layers(support: ParameterSupport, numeric: Int[Array, " m"]) -> ParameterSupport:
    """Each numeric unknown as the weight of a layer of its own, everywhere; these come last."""
    count, unknowns = len(numeric), len(support.region)
    (layers, directions), (vertices, regions) = support.Q.shape, support.masks.shape
    Q = np.zeros((layers + count, directions + count), np.float32)
    Q[:layers, :directions] = support.Q
    Q[layers:, directions:] = np.eye(count)
    region, direction = support.region.copy(), support.direction.copy()
    region[numeric] = regions
    direction[numeric] = directions + np.arange(count)
    return ParameterSupport(
        sets=np.arange(unknowns, dtype=np.int32)[None],
        sizes=np.array([unknowns], np.int32),
        set_of=np.zeros(len(support.set_of), np.int32),
        region=region,
        direction=direction,
        Q=Q,
        masks=np.column_stack([support.masks, np.ones(vertices, np.float32)]),
        triangles=support.triangles,
    )
