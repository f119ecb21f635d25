"""One expression of a person whose neutral head is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.detector import NO_FACE
from mien.capture.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.source import View
from mien.errors import EstimationError
from mien.model.expression.explain import Explained, explain
from mien.model.expression.follow import follow_skin
from mien.model.expression.gaze import MOST_RAD, iris_directions, yaw_pitch_of
from mien.model.expression.known import KnownHead, feature_sightings
from mien.model.features import Features, gather_features
from mien.model.landmark_fit import focal_beliefs
from mien.model.resection import place_cameras
from mien.model.sightings import Sightings
from mien.model.skin import move_skin
from mien.model.verdict import PhotoFit, judge_marks

FOLLOWED_MM = (1.6, 0.8)
"""What a pixel shows while skin is followed, from round to round."""
SAME_LENS_SD = 0.003
"""Of the log focal length of a frame of the clip that the neutral photos come from."""
_STEADY = ("eyeLook", "tongueOut")
"""Units that landmarks do not tell: gaze has the irises, the tongue has nothing."""
_CLOSED = 0.5
"""Weight of a blink at which an iris cannot be seen any more."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ExpressionFit:
    """An expression in the neutral head's frame.

    Attributes:
        vertices: (V, 3) mm, head space, eyeballs as in neutral.
        units: (52,) weights of the face units that explain it.
        gaze: (2, 2) rad, yaw and pitch of the left and the right eye beyond where they look in
            neutral.
        photos: by photo name, those that fit. left_out: why, by photo name, the others did not.
    """

    vertices: Float[Array, "v 3"]
    units: Float[Array, " 52"]
    gaze: Float[Array, "2 2"]
    photos: dict[str, PhotoFit]
    left_out: dict[str, str]
    notes: tuple[str, ...] = ()


def fit_expression(
    views: Sequence[View], known: KnownHead, *, progress: Progress | None = None
) -> ExpressionFit:
    """Cameras, face units and shape of an expression, from one photo on.

    Cameras and units come together from landmarks and marks, then again with the skin that is
    found again from the neutral photos; what is left moves the skin smoothly. Depth that the
    photos do not tell is the units'.

    Raises: EstimationError: no photo shows a face.
    Source: P02 sec. 5.1 with the neutral head as the prior; the units and the dense matching are
        ours.
    """
    from threadpoolctl import threadpool_limits

    tell = progress or (lambda done, total: None)
    left_out = {view.photo.name: NO_FACE for view in views if not view.marked}
    views = [view for view in views if view.marked]
    if not views:
        raise EstimationError(f"{', '.join(left_out)}: {NO_FACE}")
    with threadpool_limits(1, user_api="blas"):
        return _fit(views, known, left_out, tell)


def _fit(
    views: Sequence[View], known: KnownHead, left_out: dict[str, str], tell: Progress
) -> ExpressionFit:
    generic = known.generic
    features = gather_features(views, generic)
    focal, focal_sd = _lenses(views, known)
    sightings = feature_sightings(features, known)
    expected = _expected_units(views, known)
    free = np.array([not name.startswith(_STEADY) for name in generic.unit_names])
    cameras = place_cameras(views, features, focal, known.vertices)
    found = Explained(cameras, np.where(free, expected, 0.0))
    found = explain(sightings, found, expected, focal_sd, known, free=free)
    vertices = found.vertices(known)
    held = _held(generic)
    for step, scale in enumerate(FOLLOWED_MM):
        tell(step, len(FOLLOWED_MM))
        vertices = move_skin(vertices, sightings, found.cameras, generic, held=held)
        everything = _with_skin(sightings, views, found.cameras, vertices, known, scale)
        found = explain(everything, found, expected, focal_sd, known, free=free)
        vertices = found.vertices(known)
    vertices = move_skin(vertices, everything, found.cameras, generic, held=held)
    tell(len(FOLLOWED_MM), len(FOLLOWED_MM))
    photos = _judged(views, features, found.cameras, vertices)
    gaze = _gaze(views, found, known)
    return ExpressionFit(vertices, found.weights, gaze, photos, left_out)


def _lenses(
    views: Sequence[View], known: KnownHead
) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """(K,) focal lengths, px, and the standard deviation of their logarithms."""
    beliefs = focal_beliefs(views)
    focal, deviation = beliefs.focal_px.copy(), beliefs.deviation.copy()
    for k, view in enumerate(views):
        for other, camera in zip(known.views, known.cameras, strict=True):
            if view.photo.path == other.photo.path:
                focal[k], deviation[k] = camera.focal_px, SAME_LENS_SD
    return focal, deviation


def _expected_units(views: Sequence[View], known: KnownHead) -> Float[Array, " 52"]:
    """(52,) what the detector scores above the neutral photos, as shares of what is left to 1."""
    rest, scores = (
        np.mean(
            [view.landmarks.blendshapes for view in group if view.landmarks] or [np.zeros(52)], 0
        )
        for group in (known.views, views)
    )
    share = np.clip((scores - rest) / np.maximum(1 - rest, 0.2), 0, 1)
    by_name = dict(zip(BLENDSHAPE_NAMES, share, strict=True))
    return np.array([by_name.get(name, 0.0) for name in known.generic.unit_names])


def _with_skin(
    sightings: Sightings,
    views: Sequence[View],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    known: KnownHead,
    scale: float,
) -> Sightings:
    """The sightings and the skin that is found again."""
    for k, (view, camera) in enumerate(zip(views, cameras, strict=True)):
        skin = follow_skin(view, camera, vertices, known, photo=k, mm_per_px=scale)
        if skin is not None:
            sightings = sightings.joined(skin)
    return sightings


def _held(generic: GenericHead) -> Float[Array, " v"]:
    """(V,) in [0, 1]: hair and ears stay."""
    still = sum(generic.regions[name] for name in ("scalp", "left_ear", "right_ear"))
    held: Array = np.minimum(np.asarray(still), 1.0)
    return held


def _judged(
    views: Sequence[View],
    features: Features,
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
) -> dict[str, PhotoFit]:
    sigma_px = features.sigma_px(cameras)
    photos = {}
    for k, (view, camera) in enumerate(zip(views, cameras, strict=True)):
        residuals = camera.project(features.on(vertices)) - features.image_points[k]
        marks = judge_marks(features, k, residuals, sigma_px[k])
        photos[view.photo.name] = PhotoFit(camera, marks)
    return photos


def _gaze(views: Sequence[View], found: Explained, known: KnownHead) -> Float[Array, "2 2"]:
    """(2, 2) rad, beyond neutral's; 0 of an eye that is shut."""
    generic = known.generic

    def mean(group: Sequence[View], cameras: Sequence[Camera]) -> Array | None:
        seen = [
            iris_directions(view, camera, known.vertices, generic)
            for view, camera in zip(group, cameras, strict=True)
        ]
        directions = [item for item in seen if item is not None]
        return yaw_pitch_of(np.mean(directions, axis=0)) if directions else None

    rest, now = mean(known.views, known.cameras), mean(views, found.cameras)
    if rest is None or now is None:
        return np.zeros((2, 2))
    blinks = [generic.unit_names.index(f"eyeBlink{side}") for side in ("Left", "Right")]
    seen = found.weights[blinks] < _CLOSED
    turned: Array = np.clip(now - rest, -MOST_RAD, MOST_RAD) * seen[:, None]
    return turned
