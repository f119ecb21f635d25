"""One size of a frame beside the face as guessed: drawn once, then moved to guesses near by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, Self

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.track.face_model import Anchor, TrackedFace
from mien.track.image.bandpass import band_pass, odd
from mien.track.image.drawing import Drawing, Lens, draw, lens_of
from mien.track.image.frame_pyramid import View
from mien.track.parameters import Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, Flows, screen_flows
from mien.track.photometric.normal_equations import Equations, sum_up
from mien.track.photometric.samples import Answers, Moved, Samples, look_up, take_samples

BAND = 0.2
"""Width of the widest structures that expressions are told by, over the face's."""


class Pictures(NamedTuple):
    """Plain luma of face and frame, where a drawing shows the face.

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
class Scene:
    """One size of a frame, and all that a phase takes as given.

    Attributes:
        anchor: the face around which the model is linear.
        target: (h, w) float32 luma of the frame, as the colours of the head's photos would be.
        weights: (h, w) of the pixels.
        scale: grey levels by which a pixel may be off and still count.
        face_px: width of the face in this size.
    """

    model: TrackedFace
    anchor: Anchor
    view: View
    target: Float[Array, "h w"]
    weights: Float[Array, "h w"]
    scale: float
    face_px: float

    def draw(self, guess: Guess, *, layers: bool) -> Drawing:
        """The face as guessed; with `layers`, every expression's picture apart."""
        face = self.model.posed(self.anchor, guess.face)
        model = self.model
        return draw(
            model.painted,
            model.grey,
            model.compared,
            face,
            guess.pose,
            self.view,
            layers=layers,
        )

    def pictures(self, guess: Guess) -> Pictures:
        """Face and frame, drawn for this guess."""
        drawing = self.draw(guess, layers=False)
        return Pictures(drawing.ids, drawing.mask, drawing.luma, self.target)


class Look(Protocol):
    """A scene around one guess."""

    @property
    def scene(self) -> Scene:
        """What is looked at."""

    @property
    def guess(self) -> Guess:
        """For which the face was drawn."""

    def equations(self, guess: Guess) -> Equations:
        """Of all unknowns, at a guess near by."""

    def pictures(self, guess: Guess) -> Pictures:
        """As the guess has them."""


Linearize = Callable[[Scene, Guess], Look]


def by_plain_pictures(scene: Scene, guess: Guess) -> Look:
    """Equations of the pose alone, analytic; rows of the face's parameters are 0."""
    drawing = scene.draw(guess, layers=False)
    shown = (drawing.layers, drawing.luma, scene.target)
    return _Sampled.of(scene, guess, drawing, shown, scene.model.pose_answers)


def by_bands(scene: Scene, guess: Guess) -> Look:
    """Equations of pose and face, analytic, over band-pass filtered pictures."""
    drawing = scene.draw(guess, layers=True)
    return _Sampled.of(scene, guess, drawing, banded(scene, drawing), scene.model.answers)


def banded(scene: Scene, drawing: Drawing) -> Compared:
    """Layers, their mixture and the target, band-pass filtered."""
    shown = (drawing.layers, drawing.luma, scene.target)
    return band_pass(*shown, drawing.mask, scene.weights, odd(BAND * scene.face_px))


@dataclass(frozen=True)
class _Sampled:
    """A Look at what was drawn for one guess. The Hessian is that guess's, wherever it is taken."""

    scene: Scene
    guess: Guess
    drawing: Drawing
    samples: Samples
    answers: Answers

    @classmethod
    def of(
        cls, scene: Scene, guess: Guess, drawing: Drawing, shown: Compared, answers: Answers
    ) -> Self:
        """Of a drawing as it is compared."""
        lens = lens_of(scene.view, guess.pose)
        samples = take_samples(drawing, *shown, scene.weights, answers, lens, scale=scene.scale)
        return cls(scene, guess, drawing, samples, answers)

    def equations(self, guess: Guess) -> Equations:
        if guess is self.guess:
            return self._first
        found = sum_up(self.samples, self._moved(guess), self._flows, self.answers, matrix=False)
        return replace(self._padded(found), matrix=self._first.matrix)

    @cached_property
    def _first(self) -> Equations:
        moved = self._moved(self.guess)
        return self._padded(sum_up(self.samples, moved, self._flows, self.answers))

    @cached_property
    def _flows(self) -> Flows:
        moves = self.scene.model.moves[: len(self.answers.region) - POSE_UNKNOWNS]
        return screen_flows(moves, self.drawing.places, self.guess.pose, self.scene.view)

    def pictures(self, guess: Guess) -> Pictures:
        drawing, model = self.drawing, self.scene.model
        weights = (guess.face.alpha - self.guess.face.alpha) @ model.basis.Q.T
        vertices = model.posed(self.scene.anchor, guess.face).vertices
        places = vertices @ guess.pose.R.T + guess.pose.t
        lens = lens_of(self.scene.view, guess.pose)
        drawn, target = np.zeros((2, *drawing.ids.shape), np.float32)
        now = (places, lens, weights.astype(np.float32), self.scene.target)

        def rows(first: int, end: int) -> None:
            _picture_rows(drawing, model.answers, *now, first, end, drawn, target)

        for_row_bands(rows, len(drawn), work=2 * drawn.size)
        return Pictures(drawing.ids, drawing.mask, drawn, target)

    def _moved(self, guess: Guess) -> Moved:
        before, after = self.guess.pose, guess.pose
        turn = after.R @ before.R.T
        lens = lens_of(self.scene.view, after)
        return Moved(turn, after.t - turn @ before.t, lens, guess.since(self.guess))

    def _padded(self, found: Equations) -> Equations:
        """Of all unknowns, where the answers are of the first few only."""
        few, count = len(found.vector), POSE_UNKNOWNS + len(self.guess.face.vector)
        matrix, vector = np.zeros((count, count)), np.zeros(count)
        matrix[:few, :few], vector[:few] = found.matrix, found.vector
        return replace(found, matrix=matrix, vector=vector)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _picture_rows(
    drawing: Drawing,
    answers: Answers,
    places: Array,
    lens: Lens,
    weights: Array,
    plain: Array,
    first: int,
    end: int,
    drawn: Array,
    target: Array,
) -> None:
    # Unpacked: to look at an array in a tuple, pixel by pixel, takes half as long again.
    ids, barycentrics, _, _, _, layers, luma = drawing
    masks, triangles = answers.masks, answers.triangles
    focal, cx, cy = lens
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
                share = b[0] * masks[i, r] + b[1] * masks[j, r] + b[2] * masks[k, r]
                for n in range(layers.shape[2]):
                    total += share * weights[r, n] * layers[row, col, n]
            drawn[row, col] = total
            X = b[0] * places[i, 0] + b[1] * places[j, 0] + b[2] * places[k, 0]
            Y = b[0] * places[i, 1] + b[1] * places[j, 1] + b[2] * places[k, 1]
            Z = b[0] * places[i, 2] + b[1] * places[j, 2] + b[2] * places[k, 2]
            x, y = np.float32(focal * X / Z + cx - 0.5), np.float32(focal * Y / Z + cy - 0.5)
            target[row, col] = look_up(flat, width, height, x, y)
