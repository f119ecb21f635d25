"""The rounds of dense registration: follow, solve, move the surface, look closer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import View
from mien.model.dense.crops import finest_mm_per_px, visible_mesh
from mien.model.dense.joint import JointSolution, Lenses, PlacePrior, Sightings, solve_jointly
from mien.model.dense.prior import HeadPrior, load_head_prior
from mien.model.dense.surface import measure_offsets, move_surface
from mien.model.dense.tracks import Tracks, find_tracks
from mien.model.features import Features
from mien.numeric.rotation import angle_between

SCALES_MM = (2.0, 1.2, 0.8, 0.5)
"""What a pixel shows, from round to round."""
FINEST_MM = 0.4
"""The same for the last look, at the surface alone."""
PLACES, FINE_PLACES = 1800, 20_000
"""Places followed in a round, and in the last look."""
ALONG_SD_MM, ACROSS_SD_MM = 10.0, 1.0
"""How far a place of the surface lies off the prior, along the surface (where the mesh may have
slid) and across it."""
HAIR_SD_MM = 10.0
"""Across the surface where hair covers it."""
ATTACHED_SD_MM = 1.5
"""How far a landmark's or mark's place lies off its attachment on the prior."""
LANDMARK_SHARE = 4.0
"""Landmarks err together, not each by itself: so many times their sigma."""
SETTLED_RAD = np.deg2rad(1.0)
COARSE_ROUNDS = 4
ENOUGH_PLACES = 150


@dataclass(frozen=True)
class Registration:
    """What the photos together tell.

    Attributes:
        cameras: one a photo. vertices: (V, 3) mm, in the prior's frame and scale.
        solution: of the last joint solve. tracks: what it rests on, and the last look's.
    """

    cameras: tuple[Camera, ...]
    vertices: Float[Array, "v 3"]
    solution: JointSolution
    tracks: Tracks
    fine: Tracks


def register_views(
    views: Sequence[View],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    features: Features,
    lenses: Lenses,
    generic: GenericHead,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Registration:
    """Cameras and shape from all the skin that the photos share."""
    prior = load_head_prior()
    tell = progress or (lambda done, total: None)
    cameras = tuple(cameras)
    anchors = np.stack([camera.R_cam_head for camera in cameras])
    scales = _scales(cameras)
    for step, scale in enumerate(scales):
        tell(step, len(scales) + 1)
        for _ in range(COARSE_ROUNDS if step == 0 else 1):
            mesh = visible_mesh(generic, vertices)
            tracks = find_tracks(views, cameras, mesh, mm_per_px=scale, places=PLACES)
            solution = _solve(tracks, cameras, anchors, vertices, features, lenses, generic, prior)
            turned = max(
                angle_between(a.R_cam_head, b.R_cam_head)
                for a, b in zip(cameras, solution.cameras, strict=True)
            )
            cameras, vertices = solution.cameras, prior.vertices(solution.coefficients)
            vertices = _moved(vertices, tracks, cameras, generic)
            if turned < SETTLED_RAD:
                break
    tell(len(scales), len(scales) + 1)
    mesh = visible_mesh(generic, vertices)
    fine = find_tracks(views, cameras, mesh, mm_per_px=FINEST_MM, places=FINE_PLACES)
    vertices = _moved(vertices, fine, cameras, generic)
    tell(len(scales) + 1, len(scales) + 1)
    return Registration(cameras, vertices, solution, tracks, fine)


def _scales(cameras: Sequence[Camera]) -> list[float]:
    """No finer than half a pixel of the photos."""
    finest = finest_mm_per_px(cameras)
    useful = [scale for scale in SCALES_MM if scale > finest]
    return [*useful, max(finest, SCALES_MM[-1])] if len(useful) < len(SCALES_MM) else useful


def _moved(
    vertices: Float[Array, "v 3"],
    tracks: Tracks,
    cameras: Sequence[Camera],
    generic: GenericHead,
) -> Float[Array, "v 3"]:
    offsets = measure_offsets(tracks, cameras, generic.mesh.with_vertices(vertices))
    return move_surface(vertices, tracks, offsets, generic)


def _solve(
    tracks: Tracks,
    cameras: Sequence[Camera],
    anchors: Float[Array, "k 3 3"],
    vertices: Float[Array, "v 3"],
    features: Features,
    lenses: Lenses,
    generic: GenericHead,
    prior: HeadPrior,
) -> JointSolution:
    """Tracks and features together: places on the mesh, what photos show of them, beliefs."""
    photo, feature = np.nonzero(features.seen)
    sigma = features.sigma_px(cameras)[photo, feature]
    sigma = np.where(features.by_hand[photo, feature], sigma, LANDMARK_SHARE * sigma)
    sightings = Sightings(
        photo=np.append(tracks.photo, photo),
        place=np.append(tracks.place, feature + len(tracks.corners)),
        image_points=np.concatenate([tracks.image_points, features.image_points[photo, feature]]),
        sigma_px=np.append(tracks.sigma_px * np.sqrt(tracks.crowding)[tracks.place], sigma),
        guides=np.append(np.ones(len(tracks.photo), bool), features.by_hand[photo, feature]),
    )

    def on(values: Array) -> Array:
        return np.concatenate([tracks.on(values), features.on(values)], axis=-2)

    precision = np.concatenate(
        [
            _track_precision(tracks, vertices, generic),
            np.tile(np.eye(3) / ATTACHED_SD_MM**2, (len(features.names), 1, 1)),
        ]
    )
    components = np.ascontiguousarray(np.swapaxes(on(prior.components), 0, 1))
    beliefs = PlacePrior(on(prior.mean), components, precision)
    return solve_jointly(cameras, on(vertices), sightings, beliefs, lenses, anchors=anchors)


def _track_precision(
    tracks: Tracks, vertices: Float[Array, "v 3"], generic: GenericHead
) -> Float[Array, "n 3 3"]:
    mesh = generic.mesh.with_vertices(vertices)
    normals = tracks.on(mesh.vertex_normals())
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = normals[:, :, None] * normals[:, None, :]
    hair = tracks.on(generic.regions["scalp"][:, None])[:, 0]
    across_sd = ACROSS_SD_MM + hair * (HAIR_SD_MM - ACROSS_SD_MM)
    precision: Array = (np.eye(3) - across) / ALONG_SD_MM**2 + across / across_sd[
        :, None, None
    ] ** 2
    return precision
