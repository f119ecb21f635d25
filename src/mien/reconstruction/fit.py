"""Photos of one expression to cameras and a shape: [Pighin 2002] sec. 5.1, and past it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.faces.detector import NO_FACE_FOUND
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.head import Verdict
from mien.progress import StepProgress
from mien.reconstruction.features import gather_features
from mien.reconstruction.landmark_fit import FitOptions, Solution, residuals_of, solve_by_features
from mien.reconstruction.mirroring import (
    MIN_PHOTOS,
    find_mirrored,
    is_suspicious,
    mirrored_view,
)
from mien.reconstruction.outliers import (
    INCONSISTENT_SIGMAS,
    classify_marks,
    depth_notes,
    find_outlier_photo,
    largest_view_angle,
    name_notes,
)
from mien.reconstruction.plausibility import edge_residual, is_head, judge
from mien.reconstruction.registration import register_solution
from mien.reconstruction.result import NeutralFit, PhotoFit
from mien.reconstruction.shape.deformation import eye_centers
from mien.reconstruction.shape.feature_alignment import align_features
from mien.reconstruction.shape.model import shape_model
from mien.reconstruction.shape.outline import fit_outline
from mien.reconstruction.shared_skin import find_other_people

__all__ = ["FitOptions", "NeutralFit", "fit_views"]

MIN_VIEW_ANGLE_DEG = 10.0
"""Photos whose viewing directions, from landmarks alone, differ by less do not determine depth."""
SAME_SIDE = "it looks from the same side as {}, and would only blur what that one shows"
MIRRORED = "{}: was mirrored, as front cameras do; it is turned back"
WRONG_FOCAL = (
    "{}: the focal length that the file states does not fit the photos, and is not used; was it "
    "cropped after it was taken?"
)
MIN_DISTANCE_RATIO = 1.3
"""Unless one is taken from so many times the distance of another: perspective shows depth, too."""


def fit_views(
    views: Sequence[CapturedView],
    generic: GenericHead,
    options: FitOptions,
    *,
    progress: StepProgress | None = None,
) -> NeutralFit:
    """Cameras and shape of one expression.

    Args:
        views: photos of the expression.
        generic: the generic head.
        options: how it is fitted.
        progress: called with the steps of the registration done and their total.

    Raises:
        EstimationError: no photo fits.

    Source:
        [Pighin 2002] sec. 5.1; the registration of several photos is ours
        (docs/method/registration.md).
    """
    from threadpoolctl import threadpool_limits

    # The matrices are small: BLAS threads that wait for each other cost several times the work.
    with threadpool_limits(1, user_api="blas"):
        fit, doubted = _fit_views(views, generic, options, progress)
        stating = [view.photo.name for view in views if view.photo.focal_prior_px is not None]
        if not stating or (fit.is_plausible and not doubted):
            return fit
        free = [_without_focal(view) for view in views]
        again, _ = _fit_views(free, generic, options, progress)
        if not again.is_plausible:
            return fit
        note = WRONG_FOCAL.format(", ".join(doubted or stating))
        return replace(again, notes=(note, *again.notes))


def _without_focal(view: CapturedView) -> CapturedView:
    return replace(view, photo=replace(view.photo, focal_prior_px=None))


def _fit_views(
    views: Sequence[CapturedView],
    generic: GenericHead,
    options: FitOptions,
    progress: StepProgress | None,
) -> tuple[NeutralFit, Sequence[str]]:
    """The fit, and the photos whose stated focal length it contradicts."""
    solution, left_out = _solve(views, generic, options, progress)
    turned_over: dict[str, CapturedView] = {}
    while (turned := _mirrored_photo(solution, turned_over, generic)) is not None:
        turned_over[turned.photo.name] = turned
        views = [turned_over.get(view.photo.name, view) for view in views]
        solution, left_out = _solve(views, generic, options, progress)
    fit = _finished(solution, left_out, generic, options)
    notes = (*(MIRRORED.format(name) for name in turned_over), *fit.notes)
    fit = replace(fit, notes=notes, turned_over=tuple(turned_over.values()))
    return fit, solution.focal_doubts


def _solve(
    views: Sequence[CapturedView],
    generic: GenericHead,
    options: FitOptions,
    progress: StepProgress | None,
) -> tuple[Solution, dict[str, str]]:
    """Cameras and shape, and why photos were left out, by name."""
    marked = [view for view in views if view.marked]
    faceless = [view for view in views if not view.marked]
    if not marked:
        names = ", ".join(view.photo.name for view in views)
        raise EstimationError(f"{names}: {NO_FACE_FOUND}")
    left_out: dict[str, str] = {}
    while True:
        solution = solve_by_features(marked, gather_features(marked, generic), generic, options)
        left_out |= solution.problems
        outlier = _outlier_photo(solution, generic, options)
        if outlier is None:
            break
        worst, why = outlier
        left_out[solution.views[worst].photo.name] = why
        marked = [view for k, view in enumerate(solution.views) if k != worst]
    if not (options.dense and options.adjust):
        return solution, left_out | {view.photo.name: NO_FACE_FOUND for view in faceless}
    found = _registered(solution, faceless, generic, options, progress)
    if not found.matches:
        strangers = find_other_people(solution.views, solution.cameras, solution.vertices, generic)
        found = replace(found, contradictions=strangers)
    return found, left_out | found.problems


def _mirrored_photo(
    solution: Solution, turned_over: Mapping[str, CapturedView], generic: GenericHead
) -> CapturedView | None:
    """A photo that was mirrored and is not among those turned over, the right way round."""
    shared = [count for count, _ in solution.matches]
    if len(solution.views) < MIN_PHOTOS or not is_suspicious(shared):
        return None
    found = find_mirrored(solution.views, solution.cameras, solution.vertices, generic)
    if found is None or solution.views[found].photo.name in turned_over:
        return None
    return mirrored_view(solution.views[found], generic)


def _finished(
    solution: Solution, left_out: dict[str, str], generic: GenericHead, options: FitOptions
) -> NeutralFit:
    """The solution with features and outline where photos show them, in head space."""
    verdict = _verdict(solution, generic)
    if options.adjust:
        solution = _with_aligned_features(solution, generic)
    vertices, cameras = _in_head_space(solution, generic, options)
    sigma_px = solution.features.sigma_px(solution.cameras)
    photos = {}
    for k, (view, camera) in enumerate(zip(solution.views, cameras, strict=True)):
        marks = classify_marks(solution.features, k, solution.residuals[k], sigma_px[k])
        matches, rms_px = solution.matches[k] if solution.matches else (0, 0.0)
        photos[view.photo.name] = PhotoFit(camera, marks, matches, rms_px)
    notes = (*solution.contradictions, *depth_notes(cameras), *solution.notes, *name_notes(photos))
    return NeutralFit(
        vertices,
        photos,
        left_out,
        notes,
        uncertainty_mm=solution.uncertainty_mm,
        verdict=verdict,
        registered=bool(solution.matches),
    )


def _verdict(solution: Solution, generic: GenericHead) -> Verdict:
    """Of the solution before its features and outline are fitted, which move what they must."""
    registered, model = bool(solution.matches), shape_model(solution.views, generic)
    return judge(
        solution.cameras,
        edge_residual(solution.features, solution.cameras, solution.residuals),
        head=is_head(solution.vertices, model, solution.features, generic, registered=registered),
        registered=registered,
        doubts=solution.notes if solution.matches else (),
        contradictions=solution.contradictions,
    )


def _registered(
    solution: Solution,
    faceless: Sequence[CapturedView],
    generic: GenericHead,
    options: FitOptions,
    progress: StepProgress | None,
) -> Solution:
    """The solution by shared skin; of one photo where all look from the same side."""
    if faceless or len(solution.views) == 1 or not _from_one_side(solution.cameras):
        return register_solution(solution, faceless, generic, progress)
    # Depth would be noise. The photo with the most information gives the shape.
    best = int(np.nansum(1 / solution.features.sigma_mm, axis=1).argmax())
    view = solution.views[best]
    alone = solve_by_features([view], gather_features([view], generic), generic, options)
    problems = {
        other.photo.name: SAME_SIDE.format(view.photo.name)
        for other in solution.views
        if other is not view
    }
    return replace(alone, problems=solution.problems | problems)


def _from_one_side(cameras: Sequence[Camera]) -> bool:
    """Whether depth is undetermined: neither another side nor another distance."""
    distance = np.array([float(camera.t_cam_head[2]) for camera in cameras])
    near = distance.max() / distance.min() < MIN_DISTANCE_RATIO
    return bool(near) and largest_view_angle(cameras) < MIN_VIEW_ANGLE_DEG


def _with_aligned_features(solution: Solution, generic: GenericHead) -> Solution:
    """The solution with eyelids and lips where landmarks show them."""
    features, cameras = solution.features, solution.cameras
    vertices = align_features(
        solution.vertices, features, cameras, generic, measured=bool(solution.matches)
    )
    vertices = fit_outline(
        vertices, solution.views, cameras, generic, measured=len(solution.views) > 1
    )
    residuals = residuals_of(features, cameras, vertices)
    return replace(solution, vertices=vertices, residuals=residuals)


def _outlier_photo(
    solution: Solution, generic: GenericHead, options: FitOptions
) -> tuple[int, str] | None:
    """The photo to leave out, if any, and why."""
    typical = solution.median_normalized_residuals
    if len(typical) < 2 or typical.min() < INCONSISTENT_SIGMAS:
        return find_outlier_photo(typical)
    # Together they make no head at all: the one to blame makes none by itself either.
    alone = [
        solve_by_features(
            [view], gather_features([view], generic), generic, options
        ).median_normalized_residuals[0]
        for view in solution.views
    ]
    worst = int(np.argmax(alone))
    off = f", they lie {alone[worst]:.0f} times their expected error off the nearest"
    return worst, f"no head has its marks in these places{off if alone[worst] < np.inf else ''}"


def _in_head_space(
    solution: Solution, generic: GenericHead, options: FitOptions
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
