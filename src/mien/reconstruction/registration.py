"""The photos registered with each other, those without a face placed among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.numeric.rotation import angle_between
from mien.progress import StepProgress
from mien.reconstruction.bundle.problem import FocalGroups
from mien.reconstruction.dense.register import (
    SCALES_MM,
    Registration,
    deviation_from_features,
    register_views,
)
from mien.reconstruction.features import gather_features
from mien.reconstruction.landmark_fit import Solution, focal_groups, focal_priors, residuals_of
from mien.reconstruction.localization.localizer import localize_views
from mien.reconstruction.plausibility import (
    MAX_EDGE_RESIDUAL,
    distance_problems,
    edge_residual,
    is_head,
)
from mien.reconstruction.shape.model import shape_model

NOTHING_SHARED = (
    "the photos share too little skin to be registered with each other: cameras and shape rest on "
    "marks and landmarks alone, which leaves cameras 5 to 15 degrees off where nothing was marked "
    "by hand"
)
MAX_ROTATION_DEG = 25.0
"""Landmarks leave cameras up to 16 degrees off."""
INCONSISTENT_REGISTRATION = (
    "the photos could not be registered with each other ({}, as where all look from nearly one "
    "side, or show different days or people): cameras and shape rest on marks and landmarks alone"
)
NOT_LOCALIZED = "no face was found in it, and it does not look like the head that the others show"


def register_solution(
    solution: Solution,
    faceless: Sequence[CapturedView],
    generic: GenericHead,
    progress: StepProgress | None = None,
) -> Solution:
    """The solution by all the skin that its photos share, with the photos localized by it added.

    Args:
        solution: from marks and landmarks.
        faceless: photos of the same expression in which nothing is marked.
        generic: the generic head.
        progress: called with steps done and their total.
    """
    solution = _registered(solution, generic, SCALES_MM, progress)
    if not faceless:
        return solution
    known = list(zip(solution.views, solution.cameras, strict=True))
    cameras = localize_views(faceless, known, solution.vertices, generic)
    placed = [(view, camera) for view, camera in zip(faceless, cameras, strict=True) if camera]
    missing = {
        view.photo.name: NOT_LOCALIZED
        for view, camera in zip(faceless, cameras, strict=True)
        if camera is None
    }
    if placed:
        views, added = zip(*known, *placed, strict=True)
        features = gather_features(views, generic)
        wider = replace(
            solution,
            views=views,
            features=features,
            cameras=added,
            residuals=residuals_of(features, added, solution.vertices),
        )
        # The others are registered already: the finer scales are enough.
        solution = _registered(wider, generic, SCALES_MM[2:], progress)
    return replace(solution, problems=solution.problems | missing)


def _registered(
    solution: Solution,
    generic: GenericHead,
    scales: Sequence[float],
    progress: StepProgress | None,
) -> Solution:
    views, focal = solution.views, _focal_groups(solution.views)
    known = (views, solution.cameras, solution.vertices, solution.features, focal, generic)
    found: Registration | None = None
    notes: tuple[str, ...] = ()
    if len(views) > 1:
        try:
            found = register_views(*known, scales=scales, progress=progress)
            notes = () if found else (NOTHING_SHARED,)
        except EstimationError as error:
            notes = (
                f"the photos could not be registered with each other ({error}): "
                "cameras and shape rest on marks and landmarks alone",
            )
    if found is None:
        return replace(solution, uncertainty_mm=deviation_from_features(*known), notes=notes)
    residuals = residuals_of(solution.features, found.cameras, found.vertices)
    problems = _problems(solution, found, residuals, generic)
    if problems:
        note = INCONSISTENT_REGISTRATION.format("; ".join(problems))
        return replace(solution, uncertainty_mm=deviation_from_features(*known), notes=(note,))
    quality = found.quality
    names = [view.photo.name for view in views]
    return replace(
        solution,
        cameras=found.cameras,
        vertices=found.vertices,
        residuals=residuals,
        uncertainty_mm=found.deviation_mm,
        notes=(*quality.notes(names), *_far_turned(names, solution.cameras, found.cameras)),
        focal_doubts=tuple(
            name for name, doubted in zip(names, found.focal_doubts, strict=True) if doubted
        ),
        matches=tuple(zip(quality.shared.tolist(), quality.rms_px.tolist(), strict=True)),
    )


def _problems(
    solution: Solution,
    found: Registration,
    residuals: Float[Array, "k n 2"],
    generic: GenericHead,
) -> list[str]:
    """Why a registration is not to be believed, if it is not."""
    problems = [*distance_problems(found.cameras)]
    if edge_residual(solution.features, found.cameras, residuals) > MAX_EDGE_RESIDUAL:
        problems.append("what would follow contradicts the landmarks")
    model = shape_model(solution.views, generic)
    if not is_head(found.vertices, model, solution.features, generic, registered=True):
        problems.append("what would follow is no head")
    return problems


def _far_turned(
    names: Sequence[str], before: Sequence[Camera], after: Sequence[Camera]
) -> tuple[str, ...]:
    """A note on each photo that registration has turned farther than landmarks can be wrong."""
    turned = np.degrees(
        angle_between(
            np.stack([camera.R_cam_head for camera in before]),
            np.stack([camera.R_cam_head for camera in after]),
        )
    )
    return tuple(
        f"{name}: was turned by {degrees:.0f} degrees from where landmarks put it; see whether the "
        "mesh lies on the face"
        for name, degrees in zip(names, turned, strict=True)
        if degrees > MAX_ROTATION_DEG
    )


def _focal_groups(views: Sequence[CapturedView]) -> FocalGroups:
    focal = focal_priors(views)
    group = np.unique(focal_groups(views), return_inverse=True)[1].reshape(-1)
    count = np.bincount(group)
    return FocalGroups(
        group,
        np.bincount(group, np.log(focal.focal_px)) / count,
        np.bincount(group, focal.deviation) / count,
    )
