"""A person whose neutral head is known, making faces that are known, seen by exact cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from marbled import GENERIC, Person, at
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.faces.landmarks import Landmarks
from mien.capture.source import CapturedView
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.features import Features, gather_features
from mien.reconstruction.observations import SurfaceObservations
from people import person

NEUTRAL = person(3)
SKIN = GENERIC.mesh.vertices_of("skin")
FACE = SKIN[(GENERIC.regions["face"][SKIN] > 0.5) & (GENERIC.regions["eye_socket"][SKIN] < 0.5)]
STEADY = np.array([not name.startswith(("eyeLook", "tongueOut")) for name in GENERIC.unit_names])


def weights_of(**units: float) -> Array:
    """(52,) weights: 0 but for those given; one without a side is that of both."""
    weights = np.zeros(52)
    for name, weight in units.items():
        sides = [name] if name in GENERIC.unit_names else [f"{name}Left", f"{name}Right"]
        weights[[GENERIC.unit_names.index(side) for side in sides]] = weight
    return weights


def making(weights: Array) -> Array:
    """(V, 3) mm: the person making a face of these units."""
    return NEUTRAL + np.tensordot(weights, GENERIC.unit_offsets, axes=1)


def looking(vertices: Array, yaw: float, pitch: float) -> Array:
    """(V, 3) mm: the head with both eyeballs turned by so many degrees about their centres."""
    about_x, about_y = rotation_from_vector(np.radians([[-pitch, 0, 0], [0, yaw, 0]]))
    result = vertices.copy()
    for name in ("left_eyeball", "right_eyeball"):
        ball = GENERIC.mesh.vertices_of(name)
        centre = vertices[ball].mean(axis=0)
        result[ball] = centre + (vertices[ball] - centre) @ (about_y @ about_x).T
    return result


def bump(middle: Array, *, width_mm: float, along: Sequence[float]) -> Array:
    """(V, 3) mm: a smooth movement of the skin around a place of the generic head."""
    away = np.linalg.norm(GENERIC.mesh.vertices - middle, axis=1)
    return np.exp(-((away / width_mm) ** 2))[:, None] * np.array(along)


def exactly_detected(
    view: CapturedView, seen_from: Camera, vertices: Array, *, scores: Array | None = None
) -> CapturedView:
    """The photo with the landmarks of a perfect detector."""
    points = seen_from.project(GENERIC.landmark_positions(vertices))
    marks = Landmarks(
        points, np.ones(478), np.zeros(52) if scores is None else scores, seen_from.R_cam_head
    )
    return replace(view, landmarks=marks)


@cache
def neutral_photo(yaw: float = 0.0) -> CapturedView:
    """The person's photo from there, with exact landmarks."""
    view = Person(NEUTRAL, 1).seen_by(at(yaw), name=f"neutral {yaw:.0f}.png")
    return exactly_detected(view, at(yaw), NEUTRAL)


@cache
def known_head(*yaws: float) -> KnownHead:
    """The person with photos from these sides, the front alone by default."""
    sides = yaws or (0.0,)
    return KnownHead(
        [neutral_photo(yaw) for yaw in sides],
        [at(yaw) for yaw in sides],
        NEUTRAL,
        GENERIC.unit_offsets,
        GENERIC,
    )


def features_of(vertices: Array, cameras: Sequence[Camera]) -> Features:
    """What perfect detectors say of this head; the photos are those of nothing."""
    views = [exactly_detected(neutral_photo(), item, vertices) for item in cameras]
    return gather_features(views, GENERIC)


def skin_seen(
    vertices: Array, cameras: Sequence[Camera], *, count: int, sigma_mm: float = 0.4
) -> SurfaceObservations:
    """Places of the face's skin, exactly where these cameras see them on this head."""
    rng = np.random.default_rng(7)
    mesh = GENERIC.mesh
    inside = mesh.triangles[mesh.triangles_of("skin")]
    inside = inside[np.isin(inside, FACE).all(axis=1)]
    normals = mesh.with_vertices(vertices).vertex_normals()
    parts = []
    for k, seen_from in enumerate(cameras):
        towards = seen_from.center - vertices
        facing = (normals * towards).sum(axis=1) > 0.3 * np.linalg.norm(towards, axis=1)
        corners = inside[facing[inside].all(axis=1)]
        corners = corners[rng.integers(len(corners), size=count)]
        barycentrics = rng.dirichlet(np.ones(3), size=count)
        places = np.einsum("mc,mcd->md", barycentrics, vertices[corners])
        parts.append(
            SurfaceObservations(
                corners,
                barycentrics,
                np.zeros((count, 3)),
                np.full(count, k),
                seen_from.project(places),
                np.full(count, sigma_mm),
            )
        )
    first, *others = parts
    for part in others:
        first = first.joined(part)
    return first


def vertices_seen(
    vertices: Array, cameras: Sequence[Camera], seen: Array, *, sigma_mm: float = 0.4
) -> SurfaceObservations:
    """These vertices, exactly where every one of the cameras sees them."""
    which = np.tile(seen, len(cameras))
    return SurfaceObservations(
        corners=np.repeat(which[:, None], 3, axis=1),
        barycentrics=np.tile([1.0, 0.0, 0.0], (len(which), 1)),
        offset=np.zeros((len(which), 3)),
        photo=np.repeat(np.arange(len(cameras)), len(seen)),
        image_points=np.concatenate([item.project(vertices[seen]) for item in cameras]),
        sigma_mm=np.full(len(which), sigma_mm),
    )


def off_px(found: Array, true: Array, camera: Camera, true_camera: Camera | None = None) -> Array:
    """(M,) px by which the face's skin is seen off its place by the (true) camera."""
    seen_from = true_camera or camera
    depth = seen_from.to_camera(true[FACE])
    facing = GENERIC.mesh.with_vertices(true).vertex_normals()[FACE] @ seen_from.R_cam_head.T
    seen = FACE[(facing * depth).sum(axis=1) < -0.3 * np.linalg.norm(depth, axis=1)]
    return np.linalg.norm(camera.project(found[seen]) - seen_from.project(true[seen]), axis=1)
