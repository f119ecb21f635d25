"""The photometric residual of one pyramid level, linearized around given parameters.

The face is drawn once, at these parameters, and warped to others near by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, Self

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.face_model import Anchor, FaceModel
from mien.track.image.bandpass import band_pass, odd
from mien.track.image.drawing import Drawing, draw
from mien.track.image.frame_pyramid import FrameCrop, Intrinsics
from mien.track.parameters import Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, ImageJacobian, image_jacobian
from mien.track.photometric.normal_equations import NormalEquations, accumulate_normal_equations
from mien.track.photometric.samples import (
    ParameterSupport,
    Samples,
    Warp,
    sample_bicubic,
    take_samples,
)

BAND = 0.2
"""Width of the widest structures that are compared for expressions, over the face's."""


class ImagePair(NamedTuple):
    """Plain luma of the drawn face and the frame.

    Attributes:
        ids: (h, w) triangles, -1 for none.
        mask: (h, w) float32, 1 where there is one.
        drawn: (h, w) float32, 0 to 255.
        target: (h, w) float32, 0 to 255.
    """

    ids: Int[Array, "h w"]
    mask: Float[Array, "h w"]
    drawn: Float[Array, "h w"]
    target: Float[Array, "h w"]


Compared = tuple[Float[Array, "h w k"], Float[Array, "h w"], Float[Array, "h w"]]
"""Layers, their mixture and the target, plain or filtered alike."""


@dataclass(frozen=True)
class PyramidLevel:
    """One level of a frame's pyramid, and all that stays constant while it is solved.

    Attributes:
        model: the head.
        anchor: the face around which the model is linear.
        crop: the frame at this level.
        target: (h, w) float32 luma of the frame, in the colours of the head's photos.
        weights: (h, w) of the pixels.
        scale: grey levels, of the robust weights (Samples).
        face_px: width of the face at this level.
    """

    model: FaceModel
    anchor: Anchor
    crop: FrameCrop
    target: Float[Array, "h w"]
    weights: Float[Array, "h w"]
    scale: float
    face_px: float

    def draw(self, parameters: Parameters, *, layers: bool) -> Drawing:
        """The face with these parameters; with `layers`, every expression's picture apart."""
        face = self.model.posed(self.anchor, parameters.face)
        model = self.model
        return draw(
            model.painted,
            model.grey,
            model.compared,
            face,
            parameters.pose,
            self.crop,
            layers=layers,
        )

    def image_pair(self, parameters: Parameters) -> ImagePair:
        """Face and frame, drawn for these parameters."""
        drawing = self.draw(parameters, layers=False)
        return ImagePair(drawing.ids, drawing.mask, drawing.luma, self.target)


class Linearization(Protocol):
    """The residual of a level, linearized around parameters."""

    @property
    def level(self) -> PyramidLevel:
        """Whose residual it is."""

    @property
    def parameters(self) -> Parameters:
        """Around which it is linear: the face was drawn with them."""

    def normal_equations(self, parameters: Parameters) -> NormalEquations:
        """Of all unknowns, at parameters near by."""

    def image_pair(self, parameters: Parameters) -> ImagePair:
        """Face and frame at parameters near by."""


Linearizer = Callable[[PyramidLevel, Parameters], Linearization]


def linearize_pose(level: PyramidLevel, parameters: Parameters) -> Linearization:
    """Analytic, of the pose alone, over plain pictures; rows of the face's parameters are 0."""
    drawing = level.draw(parameters, layers=False)
    compared = (drawing.layers, drawing.luma, level.target)
    return _SampledLinearization.of(level, parameters, drawing, compared, level.model.pose_support)


def linearize_pose_and_face(level: PyramidLevel, parameters: Parameters) -> Linearization:
    """Analytic, of pose and face, over band-pass filtered pictures."""
    drawing = level.draw(parameters, layers=True)
    return _SampledLinearization.of(
        level, parameters, drawing, band_passed(level, drawing), level.model.support
    )


def band_passed(level: PyramidLevel, drawing: Drawing) -> Compared:
    """Layers, their mixture and the target, band-pass filtered."""
    compared = (drawing.layers, drawing.luma, level.target)
    return band_pass(*compared, drawing.mask, level.weights, odd(BAND * level.face_px))


@dataclass(frozen=True)
class _SampledLinearization:
    """A Linearization by samples of one drawing. The Hessian stays that of its own parameters."""

    level: PyramidLevel
    parameters: Parameters
    drawing: Drawing
    samples: Samples
    support: ParameterSupport

    @classmethod
    def of(
        cls,
        level: PyramidLevel,
        parameters: Parameters,
        drawing: Drawing,
        compared: Compared,
        support: ParameterSupport,
    ) -> Self:
        """From a drawing and the pictures that are compared."""
        intrinsics = level.crop.intrinsics(parameters.pose.zoom)
        samples = take_samples(
            drawing, *compared, level.weights, support, intrinsics, scale=level.scale
        )
        return cls(level, parameters, drawing, samples, support)

    def normal_equations(self, parameters: Parameters) -> NormalEquations:
        if parameters is self.parameters:
            return self._own
        return replace(self._equations(parameters, matrix=False), matrix=self._own.matrix)

    @cached_property
    def _own(self) -> NormalEquations:
        return self._equations(self.parameters, matrix=True)

    def _equations(self, parameters: Parameters, *, matrix: bool) -> NormalEquations:
        inputs = (self.samples, self._warp(parameters), self._jacobian, self.support)
        return self._padded(accumulate_normal_equations(*inputs, matrix=matrix))

    @cached_property
    def _jacobian(self) -> ImageJacobian:
        offsets = self.level.model.offsets[: len(self.support.region) - POSE_UNKNOWNS]
        return image_jacobian(
            offsets, self.drawing.positions, self.parameters.pose, self.level.crop
        )

    def image_pair(self, parameters: Parameters) -> ImagePair:
        drawing, model = self.drawing, self.level.model
        weights = (parameters.face.alpha - self.parameters.face.alpha) @ model.basis.Q.T
        vertices = model.posed(self.level.anchor, parameters.face).vertices
        positions = vertices @ parameters.pose.R.T + parameters.pose.t
        intrinsics = self.level.crop.intrinsics(parameters.pose.zoom)
        drawn, target = np.zeros((2, *drawing.ids.shape), np.float32)
        state = (positions, intrinsics, weights.astype(np.float32), self.level.target)

        def rows(first: int, end: int) -> None:
            _picture_rows(drawing, model.support, *state, first, end, drawn, target)

        for_row_bands(rows, len(drawn), work=2 * drawn.size)
        return ImagePair(drawing.ids, drawing.mask, drawn, target)

    def _warp(self, parameters: Parameters) -> Warp:
        before, after = self.parameters.pose, parameters.pose
        R = after.R @ before.R.T
        intrinsics = self.level.crop.intrinsics(after.zoom)
        return Warp(R, after.t - R @ before.t, intrinsics, parameters.minus(self.parameters))

    def _padded(self, found: NormalEquations) -> NormalEquations:
        """Normal equations of all unknowns from those of the first ones; the others' rows are 0."""
        few, count = len(found.vector), POSE_UNKNOWNS + len(self.parameters.face.vector)
        matrix, vector = np.zeros((count, count)), np.zeros(count)
        matrix[:few, :few], vector[:few] = found.matrix, found.vector
        return replace(found, matrix=matrix, vector=vector)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _picture_rows(
    drawing: Drawing,
    support: ParameterSupport,
    positions: Array,
    intrinsics: Intrinsics,
    weights: Array,
    plain: Array,
    first: int,
    end: int,
    drawn: Array,
    target: Array,
) -> None:
    # Unpacked: access to an array in a tuple, pixel by pixel, takes half as long again.
    ids, barycentrics, _, _, _, layers, luma = drawing
    masks, triangles = support.masks, support.triangles
    focal, cx, cy = intrinsics
    height, width = plain.shape
    flat = plain.reshape(height * width)
    for row in range(first, end):
        for col in range(drawn.shape[1]):
            t = ids[row, col]
            if t < 0:
                continue
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b = barycentrics[row, col]
            total = luma[row, col]
            for r in range(masks.shape[1]):
                weight = b[0] * masks[i, r] + b[1] * masks[j, r] + b[2] * masks[k, r]
                for n in range(layers.shape[2]):
                    total += weight * weights[r, n] * layers[row, col, n]
            drawn[row, col] = total
            X = b[0] * positions[i, 0] + b[1] * positions[j, 0] + b[2] * positions[k, 0]
            Y = b[0] * positions[i, 1] + b[1] * positions[j, 1] + b[2] * positions[k, 1]
            Z = b[0] * positions[i, 2] + b[1] * positions[j, 2] + b[2] * positions[k, 2]
            x, y = np.float32(focal * X / Z + cx - 0.5), np.float32(focal * Y / Z + cy - 0.5)
            target[row, col] = sample_bicubic(flat, width, height, x, y)
