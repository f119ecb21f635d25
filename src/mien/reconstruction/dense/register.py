"""The rounds of dense registration: follow, solve, move the surface, look closer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.rotation import angle_between
from mien.progress import StepProgress, no_step_progress
from mien.reconstruction.bundle.problem import FocalGroups, Observations, PointPrior
from mien.reconstruction.bundle.projection import POSE_SIZE
from mien.reconstruction.dense.crops import finest_mm_per_px, visible_mesh
from mien.reconstruction.dense.eyeballs import fit_eyeballs
from mien.reconstruction.dense.joint import (
    INDEPENDENT_POINTS,
    JointSolution,
    noise_variance,
    solve_jointly,
)
from mien.reconstruction.dense.prior import HeadPrior, load_head_prior
from mien.reconstruction.dense.quality import (
    MIN_SHARED_POINTS,
    RegistrationQuality,
    assess_registration,
)
from mien.reconstruction.dense.surface import NO_OFFSETS, Offsets, measure_offsets, move_surface
from mien.reconstruction.dense.tracks import NO_TRACKS, Tracks, find_tracks
from mien.reconstruction.dense.uncertainty import vertex_deviation
from mien.reconstruction.features import Features
from mien.reconstruction.shape.deformation import deform_head
from mien.reconstruction.triangulation import triangulate

SCALES_MM = (2.0, 1.2, 0.8, 0.5)
"""What a pixel shows, from round to round."""
FINEST_MM = 0.4
"""The same for the last look, at the surface alone."""
POINTS, FINE_POINTS = 1800, 20_000
"""Places followed in a round, and in the last look."""
ALONG_SD_MM, ACROSS_SD_MM = 10.0, 1.0
"""How far a point of the surface lies off the prior, along the surface (where the mesh may have
slid) and across it."""
HAIR_SD_MM = 10.0
"""Across the surface where hair covers it."""
ATTACHED_SD_MM, NAMED_SD_MM = 1.5, 6.0
"""How far a landmark's point lies off its attachment on the prior, and a hand-made mark's off the
vertex of its name: people differ in what they mean by one, and marks count in the end, not here."""
LANDMARK_SIGMA_FACTOR = 4.0
"""Landmarks err together, not each by itself: so many times their sigma."""
KNOWN_FOCAL, FREE_FOCAL = 0.3, 0.6
"""Standard deviation of a log focal length that a file states, below; and of one that is free."""
MIN_FOCAL_DOUBT = np.log(1.25)
"""A focal length that photos contradict by less is believed."""
CONVERGED_RAD = np.deg2rad(1.0)
COARSE_ROUNDS = 4
MIN_TRACKED_POINTS = 150
"""Least number of points shared by all photos together."""


@dataclass(frozen=True)
class Registration:
    """Cameras and shape from all photos together.

    Attributes:
        cameras: one a photo.
        vertices: (V, 3) mm, in the prior's frame and scale.
        deviation_mm: (V,) standard deviation of each vertex, all axes together.
        quality: what the photos say of each other.
        focal_doubts: (K,) whether the photos contradict the focal length that is known of one.
    """

    cameras: tuple[Camera, ...]
    vertices: Float[Array, "v 3"]
    deviation_mm: Float[Array, " v"]
    quality: RegistrationQuality
    focal_doubts: Bool[Array, " k"]


def register_views(
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    features: Features,
    focal: FocalGroups,
    generic: GenericHead,
    *,
    scales: Sequence[float] = SCALES_MM,
    progress: StepProgress | None = None,
) -> Registration | None:
    """Cameras and shape from all the skin that the photos share, from coarse to fine.

    Args:
        views: K photos.
        cameras: from landmarks, within some 15 degrees.
        vertices: from landmarks, within some 15 degrees.
        features: landmarks and marks of the same photos. Landmarks determine which point of the
            mesh is which, and lead the camera of a photo that shares too little with the others;
            marks lead all cameras, and the head passes through them in the end.
        focal: which photos share a focal length, and their priors.
        generic: the generic head.
        scales: mm a px, from round to round.
        progress: called with steps done and their total.

    Returns:
        None where the photos share too little that looks alike.
    """
    progress = progress or no_step_progress
    prior = load_head_prior()
    problem = _Problem(views, features, focal, generic, prior, _rotations(cameras))
    state = _State(tuple(cameras), vertices)
    scales = _useful(scales, cameras)
    for step, scale in enumerate(scales):
        progress(step, len(scales) + 1)
        for _ in range(COARSE_ROUNDS if step == 0 else 1):
            before, tracks = state.cameras, problem.tracks(state, scale, POINTS)
            if len(tracks.corners) < MIN_TRACKED_POINTS:
                return None
            state, solution = problem.round(state, tracks)
            if _largest_turn(before, state.cameras) < CONVERGED_RAD:
                break
    progress(len(scales), len(scales) + 1)
    finest = problem.tracks(state, max(FINEST_MM, finest_mm_per_px(state.cameras)), FINE_POINTS)
    vertices, offsets = problem.moved(state.vertices, finest, state.cameras)
    vertices = fit_eyeballs(_on_marks(vertices, features, state.cameras, generic), generic)
    count = len(solution.state.coefficients)
    deviation = vertex_deviation(
        solution.covariance[-count:, -count:], prior, finest, offsets, generic
    )
    progress(len(scales) + 1, len(scales) + 1)
    quality = assess_registration(tracks, solution, generic)
    doubts = problem.doubted_focal_lengths(state, tracks)
    return Registration(state.cameras, vertices, deviation, quality, doubts[focal.group])


def deviation_from_features(
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    features: Features,
    focal: FocalGroups,
    generic: GenericHead,
) -> Float[Array, " v"]:
    """(V,) mm: standard deviation of a head from landmarks and marks alone (one photo)."""
    prior = load_head_prior()
    problem = _Problem(views, features, focal, generic, prior, _rotations(cameras))
    solution = problem.solve(_State(tuple(cameras), vertices), NO_TRACKS)
    count = len(solution.state.coefficients)
    covariance = solution.covariance[-count:, -count:]
    return vertex_deviation(covariance, prior, NO_TRACKS, NO_OFFSETS, generic)


@dataclass(frozen=True)
class _State:
    cameras: tuple[Camera, ...]
    vertices: Float[Array, "v 3"]


@dataclass(frozen=True)
class _Problem:
    """What stays the same from round to round."""

    views: Sequence[CapturedView]
    features: Features
    focal: FocalGroups
    generic: GenericHead
    prior: HeadPrior
    prior_rotations: Float[Array, "k 3 3"]

    def round(self, state: _State, tracks: Tracks) -> tuple[_State, JointSolution]:
        """Solve for all, then move the surface."""
        solution = self.solve(state, tracks)
        vertices = self.prior.vertices(solution.state.coefficients)
        vertices, _ = self.moved(vertices, tracks, solution.cameras)
        return _State(solution.cameras, vertices), solution

    def tracks(self, state: _State, scale: float, points: int) -> Tracks:
        """Places of the surface that several photos show."""
        mesh = visible_mesh(self.generic, state.vertices)
        return find_tracks(self.views, state.cameras, mesh, mm_per_px=scale, points=points)

    def moved(
        self, vertices: Float[Array, "v 3"], tracks: Tracks, cameras: Sequence[Camera]
    ) -> tuple[Float[Array, "v 3"], Offsets]:
        """The surface where the photos put it."""
        offsets = measure_offsets(tracks, cameras, self.generic.mesh.with_vertices(vertices))
        return move_surface(vertices, tracks, offsets, self.generic), offsets

    def doubted_focal_lengths(self, state: _State, tracks: Tracks) -> Bool[Array, " g"]:
        """(G,) which known focal lengths leave their priors when the photos alone decide."""
        focal = self.focal
        known = focal.deviation < KNOWN_FOCAL
        if not known.any():
            return known
        loose = replace(focal, deviation=np.maximum(focal.deviation, FREE_FOCAL))
        solution = replace(self, focal=loose).solve(state, tracks)
        groups = len(focal.log_focal)
        first = POSE_SIZE * len(self.views)
        variance = np.diagonal(solution.covariance)[first : first + groups]
        off = np.abs(solution.state.log_focal - focal.log_focal)
        return known & (off > np.maximum(MIN_FOCAL_DOUBT, 3 * np.sqrt(variance)))

    def solve(self, state: _State, tracks: Tracks) -> JointSolution:
        """Tracks and features together: points on the mesh, what photos show of them, prior.

        Solved twice where the photos contradict each other: what is left of that in the solution
        that follows them most closely says how far they can be followed at all.
        """
        closest = self._solve(state, tracks, 1.0)
        matches = closest.normalized_residuals[: len(tracks.photo)]
        variance = noise_variance(matches, len(tracks.corners))
        return closest if variance == 1 else self._solve(state, tracks, np.sqrt(variance))

    def _solve(self, state: _State, tracks: Tracks, noise: float) -> JointSolution:
        features, prior = self.features, self.prior
        photo, feature = np.nonzero(features.observed)
        by_hand = features.by_hand[photo, feature]
        sigma = features.sigma_px(state.cameras)[photo, feature]
        # Landmarks lead a camera only where nothing better does.
        alone = np.bincount(tracks.photo, minlength=len(self.views)) < MIN_SHARED_POINTS
        leading = by_hand | alone[photo]
        sigma = np.where(leading, sigma, LANDMARK_SIGMA_FACTOR * sigma)
        overlap = np.sqrt(tracks.overlap)[tracks.point]
        observations = Observations(
            photo=np.append(tracks.photo, photo),
            point=np.append(tracks.point, feature + len(tracks.corners)),
            image_points=np.concatenate(
                [tracks.image_points, features.image_points[photo, feature]]
            ),
            sigma_px=np.append(noise * tracks.sigma_px * overlap, sigma),
            for_cameras=np.append(np.ones(len(tracks.photo), bool), leading),
        )

        def on(values: Array) -> Array:
            return np.concatenate([tracks.on(values), features.on(values)], axis=-2)

        attached_sd = np.where(features.by_hand.any(axis=0), NAMED_SD_MM, ATTACHED_SD_MM)
        attached = np.eye(3) / attached_sd[:, None, None] ** 2
        mesh = self.generic.mesh.with_vertices(state.vertices)
        point_prior = PointPrior(
            on(prior.mean),
            on(prior.components),
            np.concatenate([_skin_precision(tracks, mesh, self.generic), attached]),
        )
        return solve_jointly(
            state.cameras,
            on(state.vertices),
            observations,
            point_prior,
            self.focal,
            prior_rotations=self.prior_rotations,
        )


def _on_marks(
    vertices: Float[Array, "v 3"],
    features: Features,
    cameras: Sequence[Camera],
    generic: GenericHead,
) -> Float[Array, "v 3"]:
    """The head moved so that what was marked by hand lies where the photos show it."""
    marked = features.by_hand.any(axis=0)
    if not marked.any():
        return vertices
    image = np.where(features.by_hand[..., None], features.image_points, np.nan)[:, marked]
    points = features.on(vertices)[marked]
    goals = triangulate(cameras, image, current=points).points
    deviation = np.where(features.by_hand, features.sigma_mm, np.inf).min(axis=0)[marked]
    return deform_head(vertices, points, goals, generic, deviation_mm=deviation)


def _rotations(cameras: Sequence[Camera]) -> Float[Array, "k 3 3"]:
    return np.stack([camera.R_cam_head for camera in cameras])


def _largest_turn(before: Sequence[Camera], after: Sequence[Camera]) -> float:
    return float(angle_between(_rotations(before), _rotations(after)).max())


def _useful(scales: Sequence[float], cameras: Sequence[Camera]) -> list[float]:
    """No finer than the photos, once as fine as they are."""
    finest = finest_mm_per_px(cameras)
    return sorted({max(scale, finest) for scale in scales}, reverse=True)


def _skin_precision(tracks: Tracks, mesh: Mesh, generic: GenericHead) -> Float[Array, "n 3 3"]:
    """(N, 3, 3) 1 / mm^2: how near the surface's points lie to the prior, by direction."""
    normals = tracks.on(mesh.vertex_normals())
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = normals[:, :, None] * normals[:, None, :]
    hair = tracks.on(generic.regions["scalp"][:, None])[:, 0]
    across_sd = ACROSS_SD_MM + hair * (HAIR_SD_MM - ACROSS_SD_MM)
    along: Array = (np.eye(3) - across) / ALONG_SD_MM**2
    share = min(1.0, INDEPENDENT_POINTS / max(len(normals), 1))
    return share * (along + across / across_sd[:, None, None] ** 2)
