"""One frame: pose and face from coarse to fine, and how well they fit.

Source:
    [Pighin 2002] sec. 6.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.camera import Camera
from mien.track.face_model import Anchor, TrackedFace
from mien.track.image.colour_gain import Colours, match_colours
from mien.track.image.drawing import Pose, draw_colours
from mien.track.image.frame_pyramid import View, cut_views
from mien.track.parameters import Belief, Guess
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.level_solver import Answer, solve
from mien.track.photometric.linearization import Look, Pictures, Scene, by_bands, by_plain_pictures
from mien.track.photometric.multistart import better_start
from mien.track.photometric.numeric_jacobian import by_differences, unknowns_named
from mien.track.photometric.occlusion_weights import LEAST_SCALE, patch_trust, usual_difference
from mien.track.photometric.photometric_error import Agreement, agreement

_FIRST_SCALE = 60.0
"""Grey levels by which a pixel may be off before anything is fitted."""
_COLOUR_PACE = 0.2
"""Share of what one frame says of its colours: a camera's change slowly."""


@dataclass(frozen=True)
class FitOptions:
    """How a frame is fitted; the defaults are what works best in real time.

    Attributes:
        face_px: extent at which the face is compared; smaller ones stay as they are.
        levels: sizes of the picture, each half of the one before; 2 at least.
        iterations: at most, each time that the face is drawn.
        last: the same for the last time.
        numeric: unknowns whose Jacobian is taken by central differences: "pose", a region, a unit,
            "gaze". All are analytic by default: as good, and a tenth of the time
            (docs/notes/tracking-experiments.md).
        tolerance: relative fall of the cost at which the last ends; the others at ten times it.
    """

    face_px: float = 150.0
    levels: int = 3
    iterations: int = 2
    last: int = 2
    tolerance: float = 1e-3
    numeric: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fitted:
    """What a frame shows.

    Attributes:
        guess: of least cost.
        deviations: (N,) of its unknowns.
        information: (N - 1, N - 1) inverse covariance of all but the focal length.
        colours: of the frame over the drawn ones.
        agreement: of the frame and the drawn face.
    """

    guess: Guess
    deviations: Float[Array, " n"]
    information: Float[Array, "m m"]
    colours: Colours
    agreement: Agreement


class FrameFit:
    """Fits one head to frames.

    Attributes:
        model: the head.
        options: how.
    """

    def __init__(self, model: TrackedFace, options: FitOptions) -> None:
        self.model, self.options = model, options
        unknowns = np.arange(POSE_UNKNOWNS + len(model.neutral.vector))
        self._pose = unknowns < POSE_UNKNOWNS - 1
        self._both = unknowns != POSE_UNKNOWNS - 1
        # On the smallest size an eye is some six pixels wide, too few to tell where it looks.
        self._all_but_gaze = self._both & (unknowns < len(unknowns) - 2)
        numeric = unknowns_named(model.layout, options.numeric)
        self._by_bands = by_differences(numeric) if numeric.any() else by_bands
        self._outline = np.unique(model.painted.triangles[model.compared])

    def fit(
        self,
        pixels: UInt8[Array, "h w 3"],
        camera: Camera,
        start: Guess,
        belief: Belief,
        colours: Colours | None = None,
    ) -> Fitted | None:
        """The frame's own guess, from a start that is near.

        Pose alone first, on the smallest picture, then pose and face together: what an expression
        does to the picture, a motion of the head does in part, and one after the other they would
        approach the truth in many small steps.

        Args:
            camera: of the frame, its lens; the pose in it does not matter.
            belief: what is expected.
            colours: of the frame before, if there is one.

        Returns:
            None where the start shows no face in the frame.
        """
        anchor = self.model.anchored(start.face)
        cut = self._views(pixels, camera, start.pose, anchor)
        if cut is None:
            return None
        views, face_px = cut
        known, smallest = colours or Colours(), views[-1]
        scene = Scene(
            model=self.model,
            anchor=anchor,
            view=smallest,
            target=known.luma_before(smallest.pixels),
            weights=smallest.inside,
            scale=_FIRST_SCALE,
            face_px=face_px / 2 ** (len(views) - 1),
        )
        answer, belief = self._roughly(scene, start, belief)
        pace = 1.0 if colours is None else _COLOUR_PACE
        known = known.towards(self._colours(scene, answer.guess), pace)
        for view in views[-2::-1]:
            finest = view is views[0]
            scene = _next_scene(scene, answer.pictures, view, known, finest=finest)
            # To come near, half the pixels are enough where there are many.
            rough = replace(scene, weights=_checkered(scene.weights)) if finest else scene
            look = self._by_bands(rough, answer.guess)
            answer = self._solved(look, belief, self._both)
        # Drawn once more where it was found: to a tenth of a pixel that makes a difference.
        look = self._by_bands(scene, answer.guess)
        answer = self._solved(look, belief, self._both, last=True)
        found = (answer.guess, answer.deviations, answer.information)
        return Fitted(*found, known, agreement(answer.pictures, scene.view, scene.weights))

    def _roughly(self, scene: Scene, start: Guess, belief: Belief) -> tuple[Answer, Belief]:
        """On the smallest size; and what is expected after it."""
        guess = self._solved(by_plain_pictures(scene, start), belief, self._pose).guess
        answer = self._solved(self._by_bands(scene, guess), belief, self._all_but_gaze)
        elsewhere = better_start(scene, answer.guess, answer.pictures)
        if elsewhere is None:
            return answer, belief
        # What a leap says does not follow from the frame before.
        belief = replace(belief, mean=replace(belief.mean, face=elsewhere.face))
        look = self._by_bands(scene, elsewhere)
        return self._solved(look, belief, self._all_but_gaze), belief

    def _views(
        self, pixels: Array, camera: Camera, pose: Pose, anchor: Anchor
    ) -> tuple[list[View], float] | None:
        """The frame cut out around the face, and the face's extent in the largest, px."""
        seen_from = replace(camera, R_cam_head=pose.R, t_cam_head=pose.t)
        outline = anchor.face.vertices[self._outline]
        if seen_from.to_camera(outline)[:, 2].min() <= 1:
            return None
        points = seen_from.project(outline)
        inside = ((points > 0) & (points < [camera.width, camera.height])).all(axis=1)
        extent = float(np.ptp(points, axis=0).max())
        if inside.mean() < 0.25 or not 16 < extent < 20 * max(camera.width, camera.height):
            return None
        face_px, levels = self.options.face_px, self.options.levels
        views = cut_views(pixels, camera, points, face_px=face_px, levels=levels)
        return views, extent * views[0].focal / camera.focal_px

    def _colours(self, scene: Scene, guess: Guess) -> Colours:
        """The frame's, once the guess is roughly right."""
        model, view = self.model, scene.view
        face = model.posed(scene.anchor, guess.face)
        drawn, shown = draw_colours(model.painted, model.compared, face, guess.pose, view)
        weights = shown * view.inside
        colours = match_colours(drawn, view.pixels, weights)
        off = np.abs(colours.applied(drawn) - view.pixels).max(axis=2)
        weights = weights / (1 + (off / LEAST_SCALE) ** 2) ** 2
        return match_colours(drawn, view.pixels, weights)

    def _solved(
        self, look: Look, belief: Belief, free: Bool[Array, " n"], *, last: bool = False
    ) -> Answer:
        options = self.options
        return solve(
            look,
            belief,
            free=free,
            iterations=options.last if last else options.iterations,
            # A start for the next need not be exact.
            tolerance=options.tolerance if last else 10 * options.tolerance,
        )


def _next_scene(
    scene: Scene, seen: Pictures, view: View, colours: Colours, *, finest: bool
) -> Scene:
    """The next size, with what this one tells of which pixels to believe.

    Only on the finest is what is still not explained taken to be something else than the face.
    """
    weights = scene.view.inside * seen.mask
    usual = usual_difference(seen.drawn, seen.target, weights)
    believed = view.inside
    if finest:
        trust = patch_trust(seen.drawn, seen.target, weights, face_px=scene.face_px)
        believed = believed * _enlarged(trust, view)
    return replace(
        scene,
        view=view,
        target=colours.luma_before(view.pixels),
        weights=believed,
        scale=min(usual, scene.scale),
        face_px=2 * scene.face_px,
    )


def _checkered(weights: Float[Array, "h w"]) -> Float[Array, "h w"]:
    """Every other pixel's, as on a chessboard; the others' are 0."""
    checkered = weights.copy()
    checkered[::2, ::2] = checkered[1::2, 1::2] = 0
    return checkered


def _enlarged(trust: Float[Array, "h w"], view: View) -> Float[Array, "h w"]:
    import cv2

    return np.asarray(cv2.resize(trust, view.size, interpolation=cv2.INTER_LINEAR))
