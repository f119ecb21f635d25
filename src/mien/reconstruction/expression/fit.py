"""One expression of a person whose neutral head is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.faces.detector import NO_FACE_FOUND
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.numeric.rotation import angle_between
from mien.progress import StepProgress, no_step_progress
from mien.reconstruction.expression.gaze import (
    MAX_GAZE_RAD,
    iris_directions,
    yaw_pitch_from_directions,
)
from mien.reconstruction.expression.known_head import KnownHead, feature_observations
from mien.reconstruction.expression.skin_tracking import track_skin
from mien.reconstruction.expression.unit_fit import UnitFit, fit_unit_weights
from mien.reconstruction.features import gather_features
from mien.reconstruction.landmark_fit import focal_priors, residuals_of
from mien.reconstruction.observations import SurfaceObservations, reproject
from mien.reconstruction.outliers import (
    classify_marks,
    find_outlier_photo,
    median_normalized_residuals,
)
from mien.reconstruction.resection import MIN_FEATURES, resect_cameras
from mien.reconstruction.result import ExpressionFit, PhotoFit
from mien.reconstruction.shape.skin import deform_skin

TRACKING_MM_PER_PX = (1.6, 0.8)
"""What a pixel shows while skin is followed, from round to round."""
SAME_CAMERA_SD = 0.003
"""Of the log focal length of a frame of the clip that the neutral photos come from."""
MAX_SKIN_OFFSET_MM, MAX_ROTATION_RAD = 2.5, np.deg2rad(8.0)
"""Skin found again lies 0.8 to 1.7 mm off what the units express, in the median, and turns cameras
by 1 to 6 degrees from where landmarks put them. Skin that is somebody else's does more."""
INCONSISTENT_SKIN = (
    "{}: its skin does not look like neutral's: its shape rests on landmarks and marks"
)
_UNOBSERVED = ("eyeLook", "tongueOut")
"""Units without landmarks: gaze is measured by the irises, the tongue by nothing."""
_CLOSED = 0.5
"""Weight of a blink from which on an iris is hidden."""


def fit_expression(
    views: Sequence[CapturedView], known: KnownHead, *, progress: StepProgress | None = None
) -> ExpressionFit:
    """Cameras, face units and shape of an expression, from one photo on.

    Cameras and units come together from landmarks and marks, then again with the skin that is
    found again from the neutral photos; what is left moves the skin smoothly. Depth that the
    photos leave open is the units'.

    Raises:
        EstimationError: no photo can be used; with the reason for each.

    Source:
        [Pighin 2002] sec. 5.1 with the neutral head as the prior; the units and the dense matching
        are ours.
    """
    from threadpoolctl import threadpool_limits

    progress = progress or no_step_progress
    left_out = {view.photo.name: NO_FACE_FOUND for view in views if not view.marked}
    views = [view for view in views if view.marked]
    counts = gather_features(views, known.generic).observed.sum(axis=1) if views else []
    for view, count in zip(views, counts, strict=True):
        if count < MIN_FEATURES:
            left_out[view.photo.name] = f"{count} points are too few for a camera"
    views = [view for view in views if view.photo.name not in left_out]
    with threadpool_limits(1, user_api="blas"):
        while views:
            found = _fit(views, known, progress)
            outlier = find_outlier_photo(found.median_normalized_residuals)
            if outlier is None:
                return replace(found.fit, left_out=left_out)
            worst, why = outlier
            left_out[views[worst].photo.name] = why
            views = [view for k, view in enumerate(views) if k != worst]
    raise EstimationError("; ".join(f"{name}: {why}" for name, why in left_out.items()))


@dataclass(frozen=True)
class _FitWithResiduals:
    """A fit, and how many expected errors each photo's marks lie off, in the median."""

    fit: ExpressionFit
    median_normalized_residuals: Float[Array, " k"]


def _fit(
    views: Sequence[CapturedView], known: KnownHead, progress: StepProgress
) -> _FitWithResiduals:
    generic = known.generic
    features = gather_features(views, generic)
    focal, focal_sd = _focal_lengths(views, known)
    observations = feature_observations(features, known)
    expected = _expected_units(views, known)
    free = np.array([not name.startswith(_UNOBSERVED) for name in generic.unit_names])
    cameras = resect_cameras(views, features, focal, known.vertices)
    start = UnitFit(cameras, np.where(free, expected, 0.0))

    def refit(seen: SurfaceObservations, before: UnitFit) -> UnitFit:
        return fit_unit_weights(seen, before, expected, focal_sd, known, free=free)

    found = by_marks = refit(observations, start)
    vertices, everything, held = found.vertices(known), observations, _held(generic)
    for step, scale in enumerate(TRACKING_MM_PER_PX):
        progress(step, len(TRACKING_MM_PER_PX))
        vertices = deform_skin(vertices, everything, found.cameras, generic, held=held)
        everything = _with_skin(observations, views, found.cameras, vertices, known, scale)
        found = refit(everything, found)
        inconsistent = _inconsistent_photos(
            everything, len(observations.photo), found, by_marks, known
        )
        if inconsistent:
            everything = _without_skin(everything, len(observations.photo), inconsistent)
            found = refit(everything, by_marks)
        vertices = found.vertices(known)
    vertices = deform_skin(vertices, everything, found.cameras, generic, held=held)
    progress(len(TRACKING_MM_PER_PX), len(TRACKING_MM_PER_PX))
    residuals = residuals_of(features, found.cameras, vertices)
    sigma_px = features.sigma_px(found.cameras)
    photos = {
        view.photo.name: PhotoFit(camera, classify_marks(features, k, residuals[k], sigma_px[k]))
        for k, (view, camera) in enumerate(zip(views, found.cameras, strict=True))
    }
    notes = tuple(INCONSISTENT_SKIN.format(views[k].photo.name) for k in inconsistent)
    gaze = _gaze(views, found, known)
    fit = ExpressionFit(vertices, photos, {}, notes, units=found.weights, gaze=gaze)
    return _FitWithResiduals(fit, median_normalized_residuals(residuals, sigma_px))


def _inconsistent_photos(
    observations: SurfaceObservations,
    first: int,
    found: UnitFit,
    by_marks: UnitFit,
    known: KnownHead,
) -> list[int]:
    """Photos whose skin is not neutral's: its matches contradict each other or the marks.

    Args:
        observations: features, then skin.
        first: index of the first observation of skin.
        found: the fit to all of them.
        by_marks: the fit to the features alone.
        known: the neutral head.
    """
    errors = reproject(observations, observations.on(found.vertices(known)), found.cameras)
    inconsistent = []
    for k, (camera, before) in enumerate(zip(found.cameras, by_marks.cameras, strict=True)):
        mine = np.flatnonzero(observations.photo[first:] == k) + first
        if not len(mine):
            continue
        mm_per_px = float(camera.t_cam_head[2]) / camera.focal_px
        off = float(np.median(np.linalg.norm(errors.residuals[mine], axis=1))) * mm_per_px
        turned = float(angle_between(camera.R_cam_head, before.R_cam_head))
        if off > MAX_SKIN_OFFSET_MM or turned > MAX_ROTATION_RAD:
            inconsistent.append(k)
    return inconsistent


def _without_skin(
    observations: SurfaceObservations, first: int, photos: Sequence[int]
) -> SurfaceObservations:
    skin = np.arange(len(observations.photo)) >= first
    return observations.of(~(skin & np.isin(observations.photo, photos)))


def _focal_lengths(
    views: Sequence[CapturedView], known: KnownHead
) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """(K,) focal lengths, px, and the standard deviation of their logarithms."""
    priors = focal_priors(views)
    focal, deviation = priors.focal_px.copy(), priors.deviation.copy()
    for k, view in enumerate(views):
        for other, camera in zip(known.views, known.cameras, strict=True):
            if view.photo.path == other.photo.path:
                focal[k], deviation[k] = camera.focal_px, SAME_CAMERA_SD
    return focal, deviation


def _expected_units(views: Sequence[CapturedView], known: KnownHead) -> Float[Array, " 52"]:
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
    observations: SurfaceObservations,
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    known: KnownHead,
    scale: float,
) -> SurfaceObservations:
    """The observations and the skin that is found again."""
    for k, (view, camera) in enumerate(zip(views, cameras, strict=True)):
        skin = track_skin(view, camera, vertices, known, photo=k, mm_per_px=scale)
        if skin is not None:
            observations = observations.joined(skin)
    return observations


def _held(generic: GenericHead) -> Float[Array, " v"]:
    """(V,) in [0, 1]: hair and ears stay."""
    still = sum(generic.regions[name] for name in ("scalp", "left_ear", "right_ear"))
    return np.minimum(np.asarray(still), 1.0)


def _gaze(views: Sequence[CapturedView], found: UnitFit, known: KnownHead) -> Float[Array, "2 2"]:
    """(2, 2) rad, beyond neutral's; 0 of an eye that is shut."""
    generic = known.generic

    def mean(group: Sequence[CapturedView], cameras: Sequence[Camera]) -> Array | None:
        seen = [
            iris_directions(view, camera, known.vertices, generic)
            for view, camera in zip(group, cameras, strict=True)
        ]
        directions = [item for item in seen if item is not None]
        return yaw_pitch_from_directions(np.mean(directions, axis=0)) if directions else None

    rest, now = mean(known.views, known.cameras), mean(views, found.cameras)
    if rest is None or now is None:
        return np.zeros((2, 2))
    blinks = [generic.unit_names.index(f"eyeBlink{side}") for side in ("Left", "Right")]
    seen = found.weights[blinks] < _CLOSED
    return np.clip(now - rest, -MAX_GAZE_RAD, MAX_GAZE_RAD) * seen[:, None]
