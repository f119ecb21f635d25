"""Pose and face in one frame, from coarse to fine, and how well they explain it.

Source:
    [Pighin 2002] sec. 6.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.camera import Camera
from mien.track.face_model import Anchor, FaceModel
from mien.track.image.colour_gain import ColourGain, estimate_colour_gain
from mien.track.image.drawing import Pose, draw_colours
from mien.track.image.frame_pyramid import FrameCrop, crop_pyramid
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import LevelSolution, solve_level
from mien.track.photometric.linearization import (
    ImagePair,
    Linearization,
    PyramidLevel,
    linearize_pose,
    linearize_pose_and_face,
)
from mien.track.photometric.multistart import better_start
from mien.track.photometric.numeric_jacobian import numeric_linearizer, select_unknowns
from mien.track.photometric.photometric_error import (
    MIN_OUTLIER_SCALE,
    PhotometricError,
    occlusion_weights,
    outlier_scale,
    photometric_error,
)

_FIRST_SCALE = 60.0
"""Grey levels, outlier scale before anything is fitted."""
_COLOUR_UPDATE = 0.2
"""Weight of a new frame in the running mean of gain and bias: a camera's change slowly."""


@dataclass(frozen=True)
class FrameFitOptions:
    """How a frame is fitted; the defaults are what works best in real time.

    Attributes:
        face_px: extent at which the face is compared; smaller ones stay as they are.
        levels: of the image pyramid, each half the size of the one before; 2 at least.
        iterations: at most, each time that the face is drawn.
        last: the same for the last time.
        numeric: unknowns whose Jacobian is taken by central differences: "pose", a region, a unit,
            "gaze". All are analytic by default: as good, and a tenth of the time
            (docs/notes/tracking-experiments.md).
        tolerance: relative decrease of the cost at which the last ends; the others at ten times it.
    """

    face_px: float = 150.0
    levels: int = 3
    iterations: int = 2
    last: int = 2
    tolerance: float = 1e-3
    numeric: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrameSolution:
    """Parameters of a frame, and their accuracy.

    Attributes:
        parameters: of least cost.
        deviations: (N,) standard deviations of the unknowns.
        information: (N - 1, N - 1) inverse covariance of all but the focal length.
        colour_gain: of the frame over the drawn face.
        error: of the drawn face.
    """

    parameters: Parameters
    deviations: Float[Array, " n"]
    information: Float[Array, "m m"]
    colour_gain: ColourGain
    error: PhotometricError


class FrameFitter:
    """Fits one head to frames.

    Attributes:
        model: the head.
        options: how.
    """

    def __init__(self, model: FaceModel, options: FrameFitOptions) -> None:
        self.model, self.options = model, options
        unknowns = np.arange(POSE_UNKNOWNS + len(model.neutral.vector))
        self._pose = unknowns < POSE_UNKNOWNS - 1
        self._both = unknowns != POSE_UNKNOWNS - 1
        # On the coarsest level an eye is some six pixels wide, too few for its gaze.
        self._all_but_gaze = self._both & (unknowns < len(unknowns) - 2)
        numeric = select_unknowns(model.layout, options.numeric)
        self._linearize = numeric_linearizer(numeric) if numeric.any() else linearize_pose_and_face
        self._outline = np.unique(model.painted.triangles[model.compared])

    def fit(
        self,
        pixels: UInt8[Array, "h w 3"],
        camera: Camera,
        start: Parameters,
        prior: GaussianPrior,
        colour_gain: ColourGain | None = None,
    ) -> FrameSolution | None:
        """The frame's parameters, from a start that is near.

        Pose alone first, on the coarsest level, then pose and face together: their effects on the
        picture overlap, and solved in turns they would converge in many small steps.

        Args:
            pixels: of the frame.
            camera: of the frame; its pose is ignored.
            start: where to start.
            prior: of the parameters.
            colour_gain: of the frame before, if there is one.

        Returns:
            None where the start shows no face in the frame.
        """
        anchor = self.model.anchored(start.face)
        pyramid = self._pyramid(pixels, camera, start.pose, anchor)
        if pyramid is None:
            return None
        crops, face_px = pyramid
        gain, coarsest = colour_gain or ColourGain(), crops[-1]
        level = PyramidLevel(
            model=self.model,
            anchor=anchor,
            crop=coarsest,
            target=gain.corrected_luma(coarsest.pixels),
            weights=coarsest.valid,
            scale=_FIRST_SCALE,
            face_px=face_px / 2 ** (len(crops) - 1),
        )
        solution, prior = self._coarsest(level, start, prior)
        update = 1.0 if colour_gain is None else _COLOUR_UPDATE
        gain = gain.towards(self._colour_gain(level, solution.parameters), update)
        for crop in crops[-2::-1]:
            finest = crop is crops[0]
            level = _next_level(level, solution.image_pair, crop, gain, finest=finest)
            # To come near, half of many pixels are enough.
            sparse = replace(level, weights=_checkered(level.weights)) if finest else level
            linearization = self._linearize(sparse, solution.parameters)
            solution = self._solved(linearization, prior, self._both)
        # Drawn once more, at the solution: this matters at a tenth of a pixel.
        linearization = self._linearize(level, solution.parameters)
        solution = self._solved(linearization, prior, self._both, last=True)
        error = photometric_error(solution.image_pair, level.crop, level.weights)
        found = (solution.parameters, solution.deviations, solution.information)
        return FrameSolution(*found, gain, error)

    def _coarsest(
        self, level: PyramidLevel, start: Parameters, prior: GaussianPrior
    ) -> tuple[LevelSolution, GaussianPrior]:
        """The solution on the coarsest level, and the prior for the other levels."""
        parameters = self._solved(linearize_pose(level, start), prior, self._pose).parameters
        solution = self._solved(self._linearize(level, parameters), prior, self._all_but_gaze)
        restart = better_start(level, solution.parameters, solution.image_pair)
        if restart is None:
            return solution, prior
        # After a jump the face of the frame before is no prior.
        prior = replace(prior, mean=replace(prior.mean, face=restart.face))
        linearization = self._linearize(level, restart)
        return self._solved(linearization, prior, self._all_but_gaze), prior

    def _pyramid(
        self, pixels: Array, camera: Camera, pose: Pose, anchor: Anchor
    ) -> tuple[list[FrameCrop], float] | None:
        """The frame around the face, and the face's extent on the finest level, px."""
        camera = replace(camera, R_cam_head=pose.R, t_cam_head=pose.t)
        outline = anchor.face.vertices[self._outline]
        if camera.to_camera(outline)[:, 2].min() <= 1:
            return None
        points = camera.project(outline)
        inside = ((points > 0) & (points < [camera.width, camera.height])).all(axis=1)
        extent = float(np.ptp(points, axis=0).max())
        if inside.mean() < 0.25 or not 16 < extent < 20 * max(camera.width, camera.height):
            return None
        face_px, levels = self.options.face_px, self.options.levels
        crops = crop_pyramid(pixels, camera, points, face_px=face_px, levels=levels)
        return crops, extent * crops[0].focal / camera.focal_px

    def _colour_gain(self, level: PyramidLevel, parameters: Parameters) -> ColourGain:
        """The frame's, once the parameters are roughly right."""
        model, crop = self.model, level.crop
        face = model.posed(level.anchor, parameters.face)
        drawn, shown = draw_colours(model.painted, model.compared, face, parameters.pose, crop)
        weights = shown * crop.valid
        colour_gain = estimate_colour_gain(drawn, crop.pixels, weights)
        off = np.abs(colour_gain.applied(drawn) - crop.pixels).max(axis=2)
        weights = weights / (1 + (off / MIN_OUTLIER_SCALE) ** 2) ** 2
        return estimate_colour_gain(drawn, crop.pixels, weights)

    def _solved(
        self,
        linearization: Linearization,
        prior: GaussianPrior,
        free: Bool[Array, " n"],
        *,
        last: bool = False,
    ) -> LevelSolution:
        options = self.options
        return solve_level(
            linearization,
            prior,
            free=free,
            iterations=options.last if last else options.iterations,
            # A start for the next need not be exact.
            tolerance=options.tolerance if last else 10 * options.tolerance,
        )


def _next_level(
    level: PyramidLevel, pair: ImagePair, crop: FrameCrop, colour_gain: ColourGain, *, finest: bool
) -> PyramidLevel:
    """The next finer level, with robust scale and weights from the residuals of this one.

    Only on the finest level are remaining residuals taken for occlusion.
    """
    valid, weights = level.crop.valid * pair.mask, crop.valid
    scale = outlier_scale(pair.drawn, pair.target, valid)
    if finest:
        unoccluded = occlusion_weights(pair.drawn, pair.target, valid, face_px=level.face_px)
        weights = weights * _enlarged(unoccluded, crop)
    return replace(
        level,
        crop=crop,
        target=colour_gain.corrected_luma(crop.pixels),
        weights=weights,
        scale=min(scale, level.scale),
        face_px=2 * level.face_px,
    )


def _checkered(weights: Float[Array, "h w"]) -> Float[Array, "h w"]:
    """Every other pixel's, as on a chessboard; the others' are 0."""
    checkered = weights.copy()
    checkered[::2, ::2] = checkered[1::2, 1::2] = 0
    return checkered


def _enlarged(weights: Float[Array, "h w"], crop: FrameCrop) -> Float[Array, "h w"]:
    import cv2

    return np.asarray(cv2.resize(weights, crop.size, interpolation=cv2.INTER_LINEAR))
