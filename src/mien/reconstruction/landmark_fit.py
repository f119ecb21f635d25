"""Cameras and shape from marks and landmarks: [Pighin 2002] sec. 5.1, and bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.reconstruction.bundle.adjustment import (
    Adjustment,
    DistancePrior,
    FocalPrior,
    ShapePrior,
    adjust_bundle,
)
from mien.reconstruction.features import Features, image_points_for_cameras, rematch_curves
from mien.reconstruction.outliers import median_normalized_residuals
from mien.reconstruction.pose.recovery import recover_pose
from mien.reconstruction.shape.deformation import vertex_uncertainty
from mien.reconstruction.shape.from_features import shape_from_features
from mien.reconstruction.shape.model import ShapeModel, shape_model
from mien.reconstruction.triangulation import triangulate

FOCAL_PRIOR_DIAGONALS = 1.7
"""Without EXIF: a focal length between a phone's (0.6 diagonals) and a cropped portrait's (3.5)."""
FOCAL_PRIOR_DEVIATION = 0.6
EXIF_DEVIATION = 0.05
NAMED_SIGMA_MM = 2.0
"""How far a marked point lies off the identity basis, each axis: what a name means differs between
faces and between people who mark them (docs/method/cameras.md)."""
ATTACHED_SIGMA_MM = 1.5
"""The same for a landmark: the detector that finds it also attached it to the generic head."""
DISTANCE_PRIOR = DistancePrior(900.0, 1.0)
"""From where people are photographed: between a selfie's 35 cm and a portrait's 2.4 m."""
MIN_DISTANCE_MM = 150.0
"""No photo of a face is taken from nearer to the eyes; a camera there is a diverged solution."""
PRIOR_DEVIATION_MM = 2.5
"""Standard deviation of a person's head from the generic one where no photo shows it."""


@dataclass(frozen=True)
class FitOptions:
    """How a fit is done; the defaults are what works best.

    Attributes:
        adjust: joint bundle adjustment under the identity prior after [Pighin 2002]'s five steps;
            without it, cameras come from the five steps and shape from ray intersection alone, as
            in [Pighin 2002].
        dense: register several photos by all the skin that they share; without it, and always for
            one photo, marks and landmarks alone decide.
        curves: "epipolar" or "arc-length", how drawn curves become points ([Pighin 2002] sec.
            5.1.3).
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


@dataclass(frozen=True)
class Solution:
    """Cameras and shape in the frame and scale of the solver.

    Attributes:
        views: K photos.
        features: of the same photos.
        cameras: of the same photos.
        vertices: (V, 3) mm.
        residuals: (K, N, 2) px, of the features.
        uncertainty_mm: (V,) standard deviation of each vertex.
        problems: why other photos were left out, by name.
        notes: for the user.
        matches: by photo, count and RMS (px) of the points that it shares with others; () without
            registration.
        focal_doubts: photos whose stated focal length the others contradict.
        contradictions: what speaks against its photos belonging together.
    """

    views: Sequence[CapturedView]
    features: Features
    cameras: tuple[Camera, ...]
    vertices: Float[Array, "v 3"]
    residuals: Float[Array, "k n 2"]
    uncertainty_mm: Float[Array, " v"]
    problems: dict[str, str]
    notes: tuple[str, ...] = ()
    matches: tuple[tuple[int, float], ...] = ()
    focal_doubts: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()

    @property
    def median_normalized_residuals(self) -> Float[Array, " k"]:
        """(K,) how many expected errors each photo's marks lie off, in the median."""
        typical = median_normalized_residuals(self.residuals, self.features.sigma_px(self.cameras))
        distance = np.array([camera.t_cam_head[2] for camera in self.cameras])
        return np.where(distance < MIN_DISTANCE_MM, np.inf, typical)


def solve_by_features(
    views: Sequence[CapturedView], features: Features, generic: GenericHead, options: FitOptions
) -> Solution:
    """[Pighin 2002]'s five steps, then, repeated: curves, joint adjustment or rays, shape."""
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
    points = start.points[features.observed[keep].any(axis=0)]
    features = features.of_photos(keep)
    model = shape_model(views, generic)
    vertices = model.mean
    for _ in range(options.rounds):
        if options.curves == "epipolar":
            features = rematch_curves(features, views, cameras, generic)
        if options.adjust:
            adjusted = _adjust(views, features, cameras, points, model)
            cameras, points, deviation = adjusted.cameras, adjusted.points, adjusted.point_sd_mm
        else:
            points, deviation = _triangulate(features, cameras, features.on(vertices))
        vertices = shape_from_features(
            features, points, cameras, generic, model, kernel=options.kernel
        )
    residuals = residuals_of(features, cameras, vertices)
    uncertainty = vertex_uncertainty(
        vertices, features.on(vertices), deviation, prior_mm=PRIOR_DEVIATION_MM
    )
    return Solution(views, features, cameras, vertices, residuals, uncertainty, problems)


def _adjust(
    views: Sequence[CapturedView],
    features: Features,
    cameras: tuple[Camera, ...],
    points: Float[Array, "n 3"],
    model: ShapeModel,
) -> Adjustment:
    """Cameras and points of highest posterior under the model of shapes."""
    by_hand = features.by_hand.any(axis=0)
    prior = ShapePrior(
        mean=features.on(model.mean),
        components=features.on(model.components),
        sigma=np.where(by_hand, NAMED_SIGMA_MM, ATTACHED_SIGMA_MM),
    )
    return adjust_bundle(
        cameras,
        points,
        features.image_points,
        sigma_px=np.where(features.observed, features.sigma_px(cameras), 1.0),
        loss="cauchy",
        shape_prior=prior,
        focal_prior=focal_priors(views),
        focal_group=focal_groups(views),
        distance_prior=DISTANCE_PRIOR,
    )


def _triangulate(
    features: Features, cameras: tuple[Camera, ...], places: Float[Array, "n 3"]
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """[Pighin 2002] sec. 5.1.3: the features where their rays meet, and how far those miss."""
    weights = 1 / features.sigma_mm**2
    rays = triangulate(cameras, features.image_points, weights=weights, current=places)
    return rays.points, np.where(rays.determined, rays.residual_mm, PRIOR_DEVIATION_MM)


def focal_priors(views: Sequence[CapturedView]) -> FocalPrior:
    """EXIF where the photo has it; otherwise anything from a phone to a cropped portrait."""
    known = [view.photo.focal_prior_px for view in views]
    diagonals = [float(np.hypot(*view.photo.size)) for view in views]
    focal = [
        FOCAL_PRIOR_DIAGONALS * diagonal if exif is None else exif
        for exif, diagonal in zip(known, diagonals, strict=True)
    ]
    deviation = [FOCAL_PRIOR_DEVIATION if exif is None else EXIF_DEVIATION for exif in known]
    return FocalPrior(np.array(focal), np.array(deviation))


def focal_groups(views: Sequence[CapturedView]) -> Int[Array, " k"]:
    """(K,) the same number for photos of one camera: the frames of a video."""
    files = [view.photo.path for view in views]
    return np.array([files.index(file) for file in files])


def residuals_of(
    features: Features, cameras: Sequence[Camera], vertices: Float[Array, "v 3"]
) -> Float[Array, "k n 2"]:
    """(K, N, 2) px: projected features of a head less the observed ones."""
    projected = np.stack([camera.project(features.on(vertices)) for camera in cameras])
    return projected - features.image_points
