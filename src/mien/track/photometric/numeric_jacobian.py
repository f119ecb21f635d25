"""[Pighin 2002]'s other way of computing the Jacobian: central differences of the drawn picture.

Nothing that is drawn is left out: what hides what, what a filter makes of a moving outline, and, if
asked for, contacts and shadows. It takes two more drawings for every unknown, where the analytic
way takes none (docs/notes/tracking-experiments.md compares them).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.errors import InputError
from mien.track.face_model import TrackedFace
from mien.track.image.drawing import Drawing
from mien.track.parameters import Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, screen_flows, vertex_flows
from mien.track.photometric.linearization import Linearize, Look, Pictures, Scene, banded
from mien.track.photometric.normal_equations import Equations, sum_up
from mien.track.photometric.samples import Answers, Moved, take_samples
from mien.track.state import Layout

STEP_PX = 0.5
"""How far a step moves the fastest part of the face."""
_LONGEST = 0.1
"""Step in the face's parameters where next to nothing moves."""


def by_differences(
    numeric: Bool[Array, " n"],
    *,
    plain: bool = False,
    exact: bool = False,
    step_px: float = STEP_PX,
) -> Linearize:
    """Equations of pose and face, some columns of the Jacobian by differences, the others analytic.

    Args:
        numeric: (N,) which unknowns are to be by differences; any, all or none.
        plain: compare plain pictures; otherwise band-pass filtered ones.
        exact: draw the rig's own face every time, contacts and shadows too, not the face that is
            linear around the scene's anchor.
        step_px: how far a step moves the fastest part of the face.

    Source:
        [Pighin 2002] sec. 6.1.3, but that the residual is differentiated, not the drawn picture
        alone: the filter takes its means over the face, and with the face the target's mean moves
        too.
    """

    def linearized(scene: Scene, guess: Guess) -> Look:
        return _Redrawn(scene, guess, np.flatnonzero(numeric), plain, exact, step_px)

    return linearized


@dataclass(frozen=True)
class _Redrawn:
    """A Look that draws every guess anew. Its fields are those of by_differences."""

    scene: Scene
    guess: Guess
    numeric: Int[Array, " m"]
    plain: bool
    exact: bool
    step_px: float

    def equations(self, guess: Guess) -> Equations:
        scene = self._around(guess)
        drawing = scene.draw(guess, layers=True)
        layers, drawn, target = _pictures(scene, drawing, self.plain)
        flows = screen_flows(scene.model.moves, drawing.places, guess.pose, scene.view)
        steps = _steps(scene.model, vertex_flows(flows, drawing.places), self.step_px)
        changes = [self._change(guess, int(n), steps[n]) for n in self.numeric]
        # What changes the picture pixel by pixel is what a layer is: equations.py knows it as such.
        layers = np.dstack([layers, *changes]) if changes else layers
        flows.counted[self.numeric] = 0
        answers = _with_layers(scene.model.answers, self.numeric)
        shown = (layers, drawn, target, scene.weights)
        samples = take_samples(drawing, *shown, answers, flows.lens, scale=scene.scale)
        moved = Moved(np.eye(3), np.zeros(3), flows.lens, np.zeros(len(flows.counted)))
        return sum_up(samples, moved, flows, answers)

    def pictures(self, guess: Guess) -> Pictures:
        return self._around(guess).pictures(guess)

    def _around(self, guess: Guess) -> Scene:
        if not self.exact:
            return self.scene
        return replace(self.scene, anchor=self.scene.model.anchored(guess.face))

    def _change(self, guess: Guess, unknown: int, step: float) -> Float[Array, "h w"]:
        """How the residual falls with an unknown; 0 where not both steps show the face."""
        ahead = np.zeros(POSE_UNKNOWNS + len(guess.face.vector))
        ahead[unknown] = step
        residuals, shown = [], []
        for moved in (guess.moved(ahead), guess.moved(-ahead)):
            seen = self._around(moved)
            drawing = seen.draw(moved, layers=False)
            _, drawn, target = _pictures(seen, drawing, self.plain)
            residuals.append(target - drawn)
            shown.append(drawing.mask > 0)
        change = (residuals[1] - residuals[0]) / np.float32(2 * step)
        return np.where(shown[0] & shown[1], change, np.float32(0))


def unknowns_named(layout: Layout, names: Sequence[str]) -> Bool[Array, " n"]:
    """Which unknowns these names stand for: `pose`, a region, a unit, `gaze`.

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


def _pictures(
    scene: Scene, drawing: Drawing, plain: bool
) -> tuple[Float[Array, "h w k"], Float[Array, "h w"], Float[Array, "h w"]]:
    """Layers, their mixture and the target as they are compared."""
    if plain:
        return drawing.layers, drawing.luma, scene.target
    return banded(scene, drawing)


def _steps(model: TrackedFace, flows: Float[Array, "v n 2"], step_px: float) -> Float[Array, " n"]:
    """(N,) that move the fastest vertex by so many px; no longer than _LONGEST in the face's."""
    outline = np.unique(model.painted.triangles[model.compared])
    fastest = np.linalg.norm(flows[outline], axis=2).max(axis=0)
    longest = np.full(len(fastest), _LONGEST)
    longest[:POSE_UNKNOWNS] = np.inf
    return np.minimum(step_px / np.maximum(fastest, 1e-9), longest)


def _with_layers(answers: Answers, numeric: Int[Array, " m"]) -> Answers:
    """As if each numeric unknown mixed in a layer of its own, everywhere; they come last."""
    count, unknowns = len(numeric), len(answers.region)
    (layers, directions), (vertices, regions) = answers.Q.shape, answers.masks.shape
    Q = np.zeros((layers + count, directions + count), np.float32)
    Q[:layers, :directions] = answers.Q
    Q[layers:, directions:] = np.eye(count)
    region, direction = answers.region.copy(), answers.direction.copy()
    region[numeric] = regions
    direction[numeric] = directions + np.arange(count)
    return Answers(
        sets=np.arange(unknowns, dtype=np.int32)[None],
        sizes=np.array([unknowns], np.int32),
        set_of=np.zeros(len(answers.set_of), np.int32),
        region=region,
        direction=direction,
        Q=Q,
        masks=np.column_stack([answers.masks, np.ones(vertices, np.float32)]),
        triangles=answers.triangles,
    )
