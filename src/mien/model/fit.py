"""Photos of one expression to cameras and a shape: the whole of P02 sec. 5.1, and past it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.detector import NO_FACE
from mien.capture.source import View
from mien.errors import EstimationError
from mien.model.deform import eye_centers
from mien.model.features import gather_features
from mien.model.landmark_fit import FitOptions, Solution, solve_by_features
from mien.model.registration import register_solution
from mien.model.verdict import (
    HOPELESS_SIGMAS,
    PhotoFit,
    depth_notes,
    find_misfit,
    judge_marks,
    name_notes,
)

__all__ = ["Fit", "FitOptions", "fit_views"]

Progress = Callable[[int, int], None]


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


def fit_views(
    views: Sequence[View],
    generic: GenericHead,
    options: FitOptions,
    *,
    progress: Progress | None = None,
) -> Fit:
    """Cameras and shape of one expression.

    Args:
        progress: told the steps of the registration done and their total.
    Raises: EstimationError: no photo fits.
    Source: P02 sec. 5.1; the registration of several photos is ours (docs/registration.md).
    """
    from threadpoolctl import threadpool_limits

    # The matrices are small: BLAS threads that wait for each other cost several times the work.
    with threadpool_limits(1, user_api="blas"):
        return _fit_views(views, generic, options, progress)


def _fit_views(
    views: Sequence[View], generic: GenericHead, options: FitOptions, progress: Progress | None
) -> Fit:
    marked = [view for view in views if view.marked]
    faceless = [view for view in views if not view.marked]
    if not marked:
        names = ", ".join(view.photo.name for view in views)
        raise EstimationError(f"{names}: {NO_FACE}")
    left_out: dict[str, str] = {}
    while True:
        solution = solve_by_features(marked, gather_features(marked, generic), generic, options)
        left_out |= solution.problems
        misfit = _misfit(solution, generic, options)
        if misfit is None:
            break
        worst, why = misfit
        left_out[solution.views[worst].photo.name] = why
        marked = [view for k, view in enumerate(solution.views) if k != worst]
    if options.dense and options.adjust:
        solution = register_solution(solution, faceless, generic, progress)
        left_out |= solution.problems
    else:
        left_out |= {view.photo.name: NO_FACE for view in faceless}
    vertices, cameras = _in_head_space(solution, generic, options)
    sigma_px = solution.features.sigma_px(solution.cameras)
    photos = {}
    for k, (view, camera) in enumerate(zip(solution.views, cameras, strict=True)):
        marks = judge_marks(solution.features, k, solution.residuals[k], sigma_px[k])
        matches, rms_px = solution.matches[k] if solution.matches else (0, 0.0)
        photos[view.photo.name] = PhotoFit(camera, marks, matches, rms_px)
    notes = (*depth_notes(cameras), *solution.notes, *name_notes(photos))
    return Fit(vertices, photos, left_out, solution.uncertainty_mm, notes)


def _misfit(
    solution: Solution, generic: GenericHead, options: FitOptions
) -> tuple[int, str] | None:
    """The photo to leave out, if any, and why."""
    typical = solution.typical_misfits
    if len(typical) < 2 or typical.min() < HOPELESS_SIGMAS:
        return find_misfit(typical)
    # Together they make no head at all: the one to blame makes none by itself either.
    alone = [
        solve_by_features(
            [view], gather_features([view], generic), generic, options
        ).typical_misfits[0]
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
