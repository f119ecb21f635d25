"""The Jacobian analytic and by differences, beside each other ([Pighin 2002] sec. 6.1.3, 6.2).

Run: python -m benchmarks.track_jacobian HEAD
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.table import markdown_table
from benchmarks.track_scenes import Performance, choose_three, cluttered, perform, with_expressions
from mien.arrays import Array, Float
from mien.io.head.head_folder import load_head
from mien.numeric.rotation import angle_between
from mien.track.face_model import FaceModel, FaceParameters
from mien.track.image.colour_gain import ColourGain
from mien.track.image.drawing import Pose
from mien.track.image.frame_pyramid import FrameCrop, crop_pyramid
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import solve_level
from mien.track.photometric.linearization import (
    ImagePair,
    Linearization,
    Linearizer,
    PyramidLevel,
    linearize_pose_and_face,
)
from mien.track.photometric.normal_equations import NormalEquations
from mien.track.photometric.numeric_jacobian import numeric_linearizer, select_unknowns

FACE_PX, LEVELS, SCALE = 150.0, 3, 40.0
EVERY = 5
"""Every so many frames one is fitted."""
BUDGETS = {"real time": (3, 1e-3), "converged": (20, 1e-6)}
"""Iterations on each size, and the relative fall of the cost at which they end."""
_POSE_OFF = (0.015,) * 3 + (1.5, 1.5, 5.0, 0.0)
_FACE_OFF = 0.1
"""Standard deviations of the start from the truth: rad, mm, log focal length; weights."""
_BELIEF = (0.1,) * 3 + (15.0, 15.0, 40.0, 0.3)
_FACE_BELIEF = 0.3
HEADER = (
    "",
    "rotation, degrees: mean",
    "greatest",
    "translation, % of distance: mean",
    "weights, mean absolute error",
    "linearizations a frame",
    "ms each",
)


@dataclass(frozen=True)
class Case:
    """One frame at all sizes, the smallest first, the truth about it, and where to start."""

    truth: Parameters
    start: Parameters
    scenes: list[PyramidLevel]


@dataclass
class Counted:
    """Linearizations, counted and timed: every guess is drawn anew."""

    way: Linearizer
    seconds: list[float] = field(default_factory=list)

    def __call__(self, level: PyramidLevel, parameters: Parameters) -> Linearization:
        return _Timed(level, parameters, self)


@dataclass(frozen=True)
class _Timed:
    """A Look whose equations are always those of a drawing of their own."""

    level: PyramidLevel
    parameters: Parameters
    counted: Counted

    def normal_equations(self, parameters: Parameters) -> NormalEquations:
        begun = time.perf_counter()
        found = self.counted.way(self.level, parameters).normal_equations(parameters)
        self.counted.seconds.append(time.perf_counter() - begun)
        return found

    def image_pair(self, parameters: Parameters) -> ImagePair:
        return self.level.image_pair(parameters)


def cases(model: FaceModel, shown: Performance, rng: np.random.Generator) -> Iterator[Case]:
    """Frames, each with a start that is off as predictions from the frame before are."""
    outline = np.unique(model.painted.triangles[model.compared])
    for pixels, frame in list(zip(shown.frames, shown.truth.frames, strict=True))[::EVERY]:
        state = frame.state
        assert state is not None
        own = FaceParameters(model.basis.alpha(state.weights), np.zeros(2), np.zeros(2))
        truth = Parameters(Pose(state.R_cam_head, state.t_cam_head), own)
        off = rng.normal(0, [*_POSE_OFF, *[_FACE_OFF] * own.alpha.size, *[0.0] * 4])
        start = truth.plus(off)
        anchor = model.anchored(start.face)
        points = shown.truth.camera(state).project(anchor.face.vertices[outline])
        camera = shown.truth.camera(state)
        views = crop_pyramid(pixels, camera, points, face_px=FACE_PX, levels=LEVELS)
        extent = float(np.ptp(points, axis=0).max()) / camera.focal_px
        yield Case(truth, start, [_scene(model, start, view, extent) for view in views[::-1]])


def _scene(model: FaceModel, start: Parameters, view: FrameCrop, extent: float) -> PyramidLevel:
    target = ColourGain().corrected_luma(view.pixels)
    anchor = model.anchored(start.face)
    return PyramidLevel(model, anchor, view, target, view.valid, SCALE, extent * view.focal)


def measure(
    model: FaceModel, fitted: Sequence[Case], way: Linearizer, iterations: int, tolerance: float
) -> list[float]:
    """A row of the table but for its name."""
    counted = Counted(way)
    errors = np.array([_errors(model, case, counted, iterations, tolerance) for case in fitted])
    rotation, translation, weights = errors.T
    each = 1000 * float(np.median(counted.seconds))
    calls = len(counted.seconds) / len(fitted)
    found = (rotation.mean(), rotation.max(), translation.mean(), weights.mean(), calls, each)
    return [float(number) for number in found]


def _errors(
    model: FaceModel, case: Case, way: Linearizer, iterations: int, tolerance: float
) -> Float[Array, " 3"]:
    """Degrees, percent of the distance, mean absolute error of the weights."""
    parameters, truth = case.start, case.truth
    deviations = np.array([*_BELIEF, *[_FACE_BELIEF] * len(parameters.face.vector)])
    free = np.arange(len(deviations)) != POSE_UNKNOWNS - 1
    prior = GaussianPrior(case.start, deviations)
    for level in case.scenes:
        parameters = solve_level(
            way(level, parameters), prior, free=free, iterations=iterations, tolerance=tolerance
        ).parameters
    turned = np.degrees(angle_between(parameters.pose.R, truth.pose.R))
    off = 100 * np.linalg.norm(parameters.pose.t - truth.pose.t) / truth.pose.t[2]
    weights = np.abs(model.weights(parameters.face) - model.weights(truth.face)).mean()
    return np.array([float(turned), float(off), float(weights)])


def ways_of(model: FaceModel) -> dict[str, Linearizer]:
    """What is compared, by name."""
    regions = model.layout.regions
    every = select_unknowns(model.layout, ("pose", *regions, *model.layout.units, "gaze"))
    face = every & ~select_unknowns(model.layout, ("pose",))
    pose = every & ~face
    return {
        "all analytic": linearize_pose_and_face,
        "pose by differences": numeric_linearizer(pose),
        "face by differences": numeric_linearizer(face),
        "all by differences": numeric_linearizer(every),
        "all by differences, steps of 1 px": numeric_linearizer(every, step_px=1.0),
        "all analytic, the rig's own face": numeric_linearizer(~every, exact=True),
        "face by differences, the rig's own face": numeric_linearizer(face, exact=True),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("head", type=Path, help="a head folder with two expressions or more")
    head = load_head(parser.parse_args().head)
    head = with_expressions(head, choose_three(head))
    rng = np.random.default_rng(6)
    model = FaceModel(head)
    fitted = list(cases(model, perform(head, background=cluttered(300, rng)), rng))
    for name, (iterations, tolerance) in BUDGETS.items():
        rows = [
            [way_name, *measure(model, fitted, way, iterations, tolerance)]
            for way_name, way in ways_of(model).items()
        ]
        print(f"\n{name}, {len(fitted)} frames\n\n{markdown_table(HEADER, rows)}", flush=True)


if __name__ == "__main__":
    main()
