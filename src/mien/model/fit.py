"""Photos of one expression to cameras and a shape: the whole of P02 sec. 5.1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import View
from mien.errors import EstimationError
from mien.model.adjust import Adjustment, FocalPrior, ShapePrior, adjust_bundle
from mien.model.deform import eye_centers, vertex_uncertainty
from mien.model.dense.joint import Lenses
from mien.model.dense.register import deviation_by_features, register_views
from mien.model.features import (
    Features,
    gather_features,
    image_points_for_cameras,
    rematch_curves,
)
from mien.model.pose import recover_pose
from mien.model.rays import intersect_rays
from mien.model.shape import shape_from_features
from mien.model.verdict import (
    HOPELESS_SIGMAS,
    PhotoFit,
    depth_notes,
    find_misfit,
    judge_marks,
    name_notes,
    typical_misfits,
)

FOCAL_PRIOR_DIAGONALS = 1.7
"""Without EXIF: a focal length between a phone's (0.6 diagonals) and a cropped portrait's (3.5)."""
FOCAL_PRIOR_DEVIATION = 0.6
EXIF_DEVIATION = 0.05
NAMED_SIGMA_MM = 2.0
"""How far a marked point lies off the identity basis, each axis: what a name means differs between
faces and between people who mark them (docs/pose-recovery.md)."""
ATTACHED_SIGMA_MM = 1.5
"""The same for a landmark: the detector that finds it also attached it to the generic head."""
NEAREST_MM = 150.0
"""No photo of a face is taken from nearer to the eyes; a camera there is a solver gone astray."""
PRIOR_DEVIATION_MM = 2.5
"""How far the generic head lies from a person's where no photo tells."""


@dataclass(frozen=True)
class Fit:
    """A fitted shape.

    Attributes:
        vertices: (V, 3) mm, head space.
        photos: by photo name, those that fit.
        left_out: why, by photo name, the others did not.
        uncertainty_mm: (V,).
        notes: what a user should know about this fit.
    """

    vertices: Float[Array, "v 3"]
    photos: dict[str, PhotoFit]
    left_out: dict[str, str]
    uncertainty_mm: Float[Array, " v"]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class FitOptions:
    """How a fit is done; the defaults are what works best.

    Attributes:
        adjust: joint bundle adjustment under the identity prior after P02's five steps; without it,
            cameras come from the five steps and shape from ray intersection alone, as in P02.
        dense: register several photos by all the skin that they share; without it, and always for
            one photo, marks and landmarks alone decide.
        curves: "epipolar" or "arc-length", how drawn curves become points (P02 sec. 5.1.3).
        kernel: radial basis of the deformation (numeric.rbf).
        interpupillary_mm: measured distance between the pupils, which sets the scale.
        rounds: times that curves and shape are refined.
    """

    adjust: bool = True
    dense: bool = True
    curves: str = "epipolar"
    kernel: str = "exponential"
    interpupillary_mm: float = 63.0
    rounds: int = 2


def fit_views(views: Sequence[View], generic: GenericHead, options: FitOptions) -> Fit:
    """Cameras and shape of one expression.

    Raises: EstimationError: no photo fits.
    Source: P02 sec. 5.1.
    """
    from threadpoolctl import threadpool_limits

    # The matrices are small: BLAS threads that wait for each other cost several times the work.
    with threadpool_limits(1, user_api="blas"):
        return _fit_views(views, generic, options)


def _fit_views(views: Sequence[View], generic: GenericHead, options: FitOptions) -> Fit:
    left_out: dict[str, str] = {}
    while True:
        solution = _solve(views, gather_features(views, generic), generic, options)
        left_out |= solution.problems
        misfit = _misfit(solution, generic, options)
        if misfit is None:
            break
        worst, why = misfit
        left_out[solution.views[worst].photo.name] = why
        views = [view for k, view in enumerate(solution.views) if k != worst]
    if options.dense and options.adjust:
        solution = _registered(solution, generic)
    vertices, cameras = _in_head_space(solution, generic, options)
    sigma_px = solution.features.sigma_px(solution.cameras)
    photos = {}
    for k, (view, camera) in enumerate(zip(solution.views, cameras, strict=True)):
        marks = judge_marks(solution.features, k, solution.residuals[k], sigma_px[k])
        matches, rms_px = solution.matches[k] if solution.matches else (0, 0.0)
        photos[view.photo.name] = PhotoFit(camera, marks, matches, rms_px)
    notes = (*depth_notes(cameras), *solution.notes, *name_notes(photos))
    return Fit(vertices, photos, left_out, solution.uncertainty_mm, notes)


def _registered(solution: _Solution, generic: GenericHead) -> _Solution:
    """The same photos registered with each other by all the skin that they share."""
    views, lenses = solution.views, _lens_beliefs(solution.views)
    known = (views, solution.cameras, solution.vertices, solution.features, lenses, generic)
    if len(views) == 1:
        return replace(solution, uncertainty_mm=deviation_by_features(*known))
    registration = register_views(*known)
    names, quality = [view.photo.name for view in views], registration.quality
    return replace(
        solution,
        cameras=registration.cameras,
        vertices=registration.vertices,
        residuals=_residuals(solution.features, registration.cameras, registration.vertices),
        uncertainty_mm=registration.deviation_mm,
        notes=quality.notes(names),
        matches=tuple(zip(quality.shared.tolist(), quality.rms_px.tolist(), strict=True)),
    )


def _lens_beliefs(views: Sequence[View]) -> Lenses:
    focal = _focal_prior(views)
    group = np.unique(_lenses(views), return_inverse=True)[1].reshape(-1)
    count = np.bincount(group)
    return Lenses(
        group,
        np.bincount(group, np.log(focal.focal_px)) / count,
        np.bincount(group, focal.deviation) / count,
    )


def _residuals(
    features: Features, cameras: Sequence[Camera], vertices: Float[Array, "v 3"]
) -> Float[Array, "k n 2"]:
    projected = np.stack([camera.project(features.on(vertices)) for camera in cameras])
    residuals: Array = projected - features.image_points
    return residuals


def _misfit(
    solution: _Solution, generic: GenericHead, options: FitOptions
) -> tuple[int, str] | None:
    """The photo to leave out, if any, and why."""
    typical = solution.typical_misfits
    if len(typical) < 2 or typical.min() < HOPELESS_SIGMAS:
        return find_misfit(typical)
    # Together they make no head at all: the one to blame makes none by itself either.
    alone = [
        _solve([view], gather_features([view], generic), generic, options).typical_misfits[0]
        for view in solution.views
    ]
    worst = int(np.argmax(alone))
    off = f", they lie {alone[worst]:.0f} times their expected error off the nearest"
    return worst, f"no head has its marks in these places{off if alone[worst] < np.inf else ''}"


@dataclass(frozen=True)
class _Solution:
    """Cameras and shape in the frame and scale of the solver."""

    views: Sequence[View]
    features: Features
    cameras: tuple[Camera, ...]
    vertices: Float[Array, "v 3"]
    residuals: Float[Array, "k n 2"]
    uncertainty_mm: Float[Array, " v"]
    problems: dict[str, str]
    notes: tuple[str, ...] = ()
    matches: tuple[tuple[int, float], ...] = ()

    @property
    def typical_misfits(self) -> Float[Array, " k"]:
        """(K,) how many expected errors each photo's marks lie off, in the median."""
        typical = typical_misfits(self.residuals, self.features.sigma_px(self.cameras))
        distance = np.array([camera.t_cam_head[2] for camera in self.cameras])
        return np.where(distance < NEAREST_MM, np.inf, typical)


def _solve(
    views: Sequence[View], features: Features, generic: GenericHead, options: FitOptions
) -> _Solution:
    """P02's five steps, then as often as asked for: curves, joint adjustment or rays, shape."""
    try:
        start = recover_pose(
            image_points_for_cameras(features),
            features.on(generic.mesh.vertices),
            np.array([view.photo.size for view in views]),
            weights=1 / features.sigma_mm**2,
        )
    except EstimationError as error:
        names = ", ".join(view.photo.name for view in views)
        raise EstimationError(f"{names}: {error}") from None
    problems = {
        view.photo.name: text for view, text in zip(views, start.problems, strict=True) if text
    }
    keep = np.array([not text for text in start.problems])
    views = [view for view in views if view.photo.name not in problems]
    cameras = tuple(camera for camera in start.cameras if camera is not None)
    points = start.points[features.seen[keep].any(axis=0)]
    features = features.of_photos(keep)
    vertices = generic.mesh.vertices
    for _ in range(options.rounds):
        if options.curves == "epipolar":
            features = rematch_curves(features, views, cameras, generic)
        if options.adjust:
            adjusted = _adjust(views, features, cameras, points, generic)
            cameras, points, deviation = adjusted.cameras, adjusted.points, adjusted.point_sd_mm
        else:
            points, deviation = _intersect(features, cameras, features.on(vertices))
        vertices = shape_from_features(features, points, cameras, generic, kernel=options.kernel)
    residuals = _residuals(features, cameras, vertices)
    uncertainty = vertex_uncertainty(
        vertices, features.on(vertices), deviation, prior_mm=PRIOR_DEVIATION_MM
    )
    return _Solution(views, features, cameras, vertices, residuals, uncertainty, problems)


def _adjust(
    views: Sequence[View],
    features: Features,
    cameras: tuple[Camera, ...],
    points: Float[Array, "n 3"],
    generic: GenericHead,
) -> Adjustment:
    """Cameras and points of highest posterior under the identity prior."""
    by_hand = features.by_hand.any(axis=0)
    prior = ShapePrior(
        mean=features.on(generic.mesh.vertices),
        components=features.on(generic.identity.components),
        sigma=np.where(by_hand, NAMED_SIGMA_MM, ATTACHED_SIGMA_MM),
    )
    return adjust_bundle(
        cameras,
        points,
        features.image_points,
        sigma_px=np.where(features.seen, features.sigma_px(cameras), 1.0),
        loss="cauchy",
        shape_prior=prior,
        focal_prior=_focal_prior(views),
        focal_group=_lenses(views),
    )


def _intersect(
    features: Features, cameras: tuple[Camera, ...], places: Float[Array, "n 3"]
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """P02 sec. 5.1.3: the features where their rays meet, and how far those miss each other."""
    weights = 1 / features.sigma_mm**2
    rays = intersect_rays(cameras, features.image_points, weights=weights, current=places)
    return rays.points, np.where(rays.solved, rays.residual_mm, PRIOR_DEVIATION_MM)


def _focal_prior(views: Sequence[View]) -> FocalPrior:
    """EXIF where the photo has it; otherwise anything from a phone to a cropped portrait."""
    known = [view.photo.focal_prior_px for view in views]
    diagonals = [float(np.hypot(*view.photo.size)) for view in views]
    focal = [
        FOCAL_PRIOR_DIAGONALS * diagonal if exif is None else exif
        for exif, diagonal in zip(known, diagonals, strict=True)
    ]
    deviation = [FOCAL_PRIOR_DEVIATION if exif is None else EXIF_DEVIATION for exif in known]
    return FocalPrior(np.array(focal), np.array(deviation))


def _lenses(views: Sequence[View]) -> Int[Array, " k"]:
    """(K,) the same number for photos of one lens: the frames of a video."""
    files = [view.photo.path for view in views]
    return np.array([files.index(file) for file in files])


def _in_head_space(
    solution: _Solution, generic: GenericHead, options: FitOptions
) -> tuple[Float[Array, "v 3"], tuple[Camera, ...]]:
    """The same picture with the origin between the eyes and the measured scale."""
    eyes = eye_centers(generic.mesh.with_vertices(solution.vertices))
    origin = eyes.mean(axis=0)
    scale = options.interpupillary_mm / float(np.linalg.norm(eyes[0] - eyes[1]))
    cameras = tuple(
        replace(camera, t_cam_head=scale * (camera.t_cam_head + camera.R_cam_head @ origin))
        for camera in solution.cameras
    )
    return scale * (solution.vertices - origin), cameras
