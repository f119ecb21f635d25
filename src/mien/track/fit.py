"""One frame: pose and face from coarse to fine (P02 sec. 6.1.2), and how well they fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera
from mien.track.colours import match_colours, pixel_weights, usual_difference
from mien.track.drawing import Pose
from mien.track.equations import POSE_UNKNOWNS
from mien.track.face import Anchor, TrackedFace
from mien.track.phases import (
    Answer,
    Belief,
    Guess,
    Linearize,
    Scene,
    by_bands,
    by_plain_pictures,
    solve,
)
from mien.track.views import View, cut_views


@dataclass(frozen=True)
class FitOptions:
    """How a frame is fitted; the defaults are what works best in real time.

    Attributes:
        face_px: width at which the face is compared; smaller ones stay as they are.
        levels: sizes of the picture, each half of the one before.
        iterations: at most, in each phase.
        tolerance: relative fall of the cost at which a phase ends.
    """

    face_px: float = 160.0
    levels: int = 3
    iterations: int = 4
    tolerance: float = 1e-4


@dataclass(frozen=True)
class Fitted:
    """What a frame shows.

    Attributes:
        guess: of least cost. deviations: (N,) of its unknowns.
        gain, bias: (3,) frame = gain * drawn + bias.
        rms: grey levels, over the pixels that count.
        seen: their share of the face.
        likeness: correlation of frame and drawn face over them, from -1 to 1.
    """

    guess: Guess
    deviations: Float[Array, " n"]
    gain: Float[Array, " 3"]
    bias: Float[Array, " 3"]
    rms: float
    seen: float
    likeness: float


class FrameFit:
    """Fits one head to frames.

    Attributes:
        model: the head. options: how.
    """

    def __init__(self, model: TrackedFace, options: FitOptions) -> None:
        self.model, self.options = model, options
        count = POSE_UNKNOWNS + len(model.neutral.vector)
        pose = np.arange(count) < POSE_UNKNOWNS - 1
        face = np.arange(count) >= POSE_UNKNOWNS
        self._pose, self._face, self._both = pose, face, pose | face
        triangles = model.painted.triangles[model.compared]
        self._outline = np.unique(triangles)

    def fit(
        self, pixels: UInt8[Array, "h w 3"], camera: Camera, start: Guess, belief: Belief
    ) -> Fitted | None:
        """The frame's own guess, from a start that is near.

        Args:
            camera: of the frame, its lens; the pose in it does not matter.
            belief: what is expected.
        Returns: None where the start shows no face in the frame.
        """
        anchor = self.model.anchored(start.face)
        found = self._views(pixels, camera, start.pose, anchor)
        if found is None:
            return None
        views, face_px = found
        guess, answer, scene = start, None, None
        for level in reversed(range(len(views))):
            scene = self._scene(anchor, views[level], guess, face_px / 2**level)
            if scene is None:
                return None
            guess = self._solved(scene, guess, belief, by_plain_pictures, self._pose).guess
            answer = self._solved(
                scene, guess, belief, by_bands, self._face if level else self._both
            )
            guess = answer.guess
            anchor = self.model.anchored(guess.face)
        scene = self._scene(anchor, views[0], guess, face_px)
        if scene is None:
            return None
        return _fitted(scene, answer)

    def _views(
        self, pixels: Array, camera: Camera, pose: Pose, anchor: Anchor
    ) -> tuple[list[View], float] | None:
        seen_from = replace(camera, R_cam_head=pose.R, t_cam_head=pose.t)
        outline = anchor.face.vertices[self._outline]
        if seen_from.to_camera(outline)[:, 2].min() <= 1:
            return None
        points = seen_from.project(outline)
        inside = ((points > 0) & (points < [camera.width, camera.height])).all(axis=1)
        extent = float(np.ptp(points, axis=0).max())
        if inside.mean() < 0.25 or not 16 < extent < 20 * max(camera.width, camera.height):
            return None
        options = self.options
        views = cut_views(
            pixels, camera, points, face_px=1.25 * options.face_px, levels=options.levels
        )
        return views, extent * views[0].focal / camera.focal_px

    def _scene(self, anchor: Anchor, view: View, guess: Guess, face_px: float) -> Scene | None:
        """Colours, and which pixels to believe, at a guess."""
        plain = Scene(self.model, anchor, view, np.ones(3), np.zeros(3), view.inside, 20.0, face_px)
        drawing = plain.draw(guess, layers=False)
        mask = drawing.mask * view.inside
        if mask.sum() < 50:
            return None
        drawn, weights = drawing.layers[:, :, 0], mask
        for _ in range(2):
            gain, bias = match_colours(drawn, view.pixels, weights)
            matched = np.asarray(drawn * gain + bias, np.float32)
            weights = pixel_weights(matched, view.pixels, mask, face_px=face_px)
        scale = usual_difference(matched, view.pixels, weights)
        # Where the face comes in a little later there is no reason to distrust.
        weights = np.where(drawing.mask > 0, weights, view.inside)
        return replace(plain, gain=gain, bias=bias, weights=np.float32(weights), scale=scale)

    def _solved(
        self, scene: Scene, guess: Guess, belief: Belief, linearized: Linearize, free: Array
    ) -> Answer:
        return solve(
            scene,
            guess,
            belief,
            linearized=linearized,
            free=free,
            iterations=self.options.iterations,
            tolerance=self.options.tolerance,
        )


def _fitted(scene: Scene, answer: Answer) -> Fitted:
    """How well the frame is explained."""
    drawing = scene.draw(answer.guess, layers=False)
    mask = drawing.mask * scene.view.inside
    weights = scene.weights * mask
    chosen = weights > 0.25
    matched = drawing.layers[:, :, 0] * scene.gain + scene.bias
    difference = (scene.view.pixels - matched)[chosen]
    rms = float(np.sqrt((difference**2).mean())) if len(difference) else np.inf
    return Fitted(
        answer.guess,
        answer.deviations,
        scene.gain,
        scene.bias,
        rms,
        float(weights.sum() / max(drawing.mask.sum(), 1.0)),
        _correlation(matched[chosen], scene.view.pixels[chosen]),
    )


def _correlation(a: Array, b: Array) -> float:
    if len(a) < 2:
        return 0.0
    a, b = a.mean(axis=1), b.mean(axis=1)
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / max(float(np.sqrt((a @ a) * (b @ b))), 1e-9))
