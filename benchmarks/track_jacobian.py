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
from mien.track.face_model import FaceParameters, TrackedFace
from mien.track.image.colour_gain import Colours
from mien.track.image.drawing import Pose
from mien.track.image.frame_pyramid import View, cut_views
from mien.track.parameters import Belief, Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import solve
from mien.track.photometric.linearization import Linearize, Look, Pictures, Scene, by_bands
from mien.track.photometric.normal_equations import Equations
from mien.track.photometric.numeric_jacobian import by_differences, unknowns_named

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

    truth: Guess
    start: Guess
    scenes: list[Scene]


@dataclass
class Counted:
    """Linearizations, counted and timed: every guess is drawn anew."""

    way: Linearize
    seconds: list[float] = field(default_factory=list)

    def __call__(self, scene: Scene, guess: Guess) -> Look:
        return _Timed(scene, guess, self)


@dataclass(frozen=True)
class _Timed:
    """A Look whose equations are always those of a drawing of their own."""

    scene: Scene
    guess: Guess
    counted: Counted

    def equations(self, guess: Guess) -> Equations:
        begun = time.perf_counter()
        found = self.counted.way(self.scene, guess).equations(guess)
        self.counted.seconds.append(time.perf_counter() - begun)
        return found

    def pictures(self, guess: Guess) -> Pictures:
        return self.scene.pictures(guess)


def cases(model: TrackedFace, shown: Performance, rng: np.random.Generator) -> Iterator[Case]:
    """Frames, each with a start that is off as predictions from the frame before are."""
    outline = np.unique(model.painted.triangles[model.compared])
    for pixels, frame in list(zip(shown.frames, shown.truth.frames, strict=True))[::EVERY]:
        state = frame.state
        assert state is not None
        own = FaceParameters(model.basis.alpha(state.weights), np.zeros(2), np.zeros(2))
        truth = Guess(Pose(state.R_cam_head, state.t_cam_head), own)
        off = rng.normal(0, [*_POSE_OFF, *[_FACE_OFF] * own.alpha.size, *[0.0] * 4])
        start = truth.moved(off)
        anchor = model.anchored(start.face)
        points = shown.truth.camera(state).project(anchor.face.vertices[outline])
        camera = shown.truth.camera(state)
        views = cut_views(pixels, camera, points, face_px=FACE_PX, levels=LEVELS)
        extent = float(np.ptp(points, axis=0).max()) / camera.focal_px
        yield Case(truth, start, [_scene(model, start, view, extent) for view in views[::-1]])


def _scene(model: TrackedFace, start: Guess, view: View, extent: float) -> Scene:
    target = Colours().luma_before(view.pixels)
    anchor = model.anchored(start.face)
    return Scene(model, anchor, view, target, view.inside, SCALE, extent * view.focal)


def measure(
    model: TrackedFace, fitted: Sequence[Case], way: Linearize, iterations: int, tolerance: float
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
    model: TrackedFace, case: Case, way: Linearize, iterations: int, tolerance: float
) -> Float[Array, " 3"]:
    """Degrees, percent of the distance, mean absolute error of the weights."""
    guess, truth = case.start, case.truth
    deviations = np.array([*_BELIEF, *[_FACE_BELIEF] * len(guess.face.vector)])
    free = np.arange(len(deviations)) != POSE_UNKNOWNS - 1
    belief = Belief(case.start, deviations)
    for scene in case.scenes:
        guess = solve(
            way(scene, guess), belief, free=free, iterations=iterations, tolerance=tolerance
        ).guess
    turned = np.degrees(angle_between(guess.pose.R, truth.pose.R))
    off = 100 * np.linalg.norm(guess.pose.t - truth.pose.t) / truth.pose.t[2]
    weights = np.abs(model.weights(guess.face) - model.weights(truth.face)).mean()
    return np.array([float(turned), float(off), float(weights)])


def ways_of(model: TrackedFace) -> dict[str, Linearize]:
    """What is compared, by name."""
    regions = model.layout.regions
    every = unknowns_named(model.layout, ("pose", *regions, *model.layout.units, "gaze"))
    face = every & ~unknowns_named(model.layout, ("pose",))
    pose = every & ~face
    return {
        "all analytic": by_bands,
        "pose by differences": by_differences(pose),
        "face by differences": by_differences(face),
        "all by differences": by_differences(every),
        "all by differences, steps of 1 px": by_differences(every, step_px=1.0),
        "all analytic, the rig's own face": by_differences(~every, exact=True),
        "face by differences, the rig's own face": by_differences(face, exact=True),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("head", type=Path, help="a head folder with two expressions or more")
    head = load_head(parser.parse_args().head)
    head = with_expressions(head, choose_three(head))
    rng = np.random.default_rng(6)
    model = TrackedFace(head)
    fitted = list(cases(model, perform(head, background=cluttered(300, rng)), rng))
    for name, (iterations, tolerance) in BUDGETS.items():
        rows = [
            [way_name, *measure(model, fitted, way, iterations, tolerance)]
            for way_name, way in ways_of(model).items()
        ]
        print(f"\n{name}, {len(fitted)} frames\n\n{markdown_table(HEADER, rows)}", flush=True)


if __name__ == "__main__":
    main()
