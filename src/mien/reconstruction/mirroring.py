"""Photos that were turned over, left for right, as front cameras do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.reconstruction.dense.crops import visible_mesh
from mien.reconstruction.shared_skin import count_shared, degrees_between

MIRRORED_RATIO = 1.0
"""A photo that shares so many times the skin with the others when it is turned over was mirrored.
Faces are not symmetric: photos the right way round share 1.2 to 2.5 times more than turned over."""
MIN_PHOTOS = 3
"""Of two, nobody can say which one was mirrored."""
SUSPICIOUS = 0.65
"""Share of what photos have in common with others, in the median, below which one is looked at."""
_NEIGHBOURS = 2
_FLIP = np.diag([-1.0, 1.0, 1.0])


def is_suspicious(shared: Sequence[int]) -> bool:
    """Whether one of these counts of points that photos share with others is small beside theirs.

    No counts are of photos that could not be registered.
    """
    return not len(shared) or bool(min(shared) < SUSPICIOUS * np.median(shared))


def find_mirrored(
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> int | None:
    """The photo that fits the others much better when it is turned over, if there is one.

    Args:
        views: K photos.
        cameras: from landmarks or better.
        vertices: (V, 3) mm, of the head.
        generic: the generic head.
    """
    mesh = visible_mesh(generic, vertices)
    best, worst = MIRRORED_RATIO, None
    for k, view in enumerate(views):
        if view.landmarks is None or view.annotations is not None:
            continue
        others = [j for j in range(len(views)) if j != k]
        plain = _shared(view, cameras[k], others, views, cameras, mesh)
        turned = mirrored_view(view, generic)
        over = _shared(turned, _mirrored_camera(cameras[k]), others, views, cameras, mesh)
        ratio = over / max(plain, 1)
        if ratio > best:
            best, worst = ratio, k
    return worst


def mirrored_view(view: CapturedView, generic: GenericHead) -> CapturedView:
    """The same photo turned over, with its landmarks."""
    assert view.landmarks is not None
    landmarks, photo, partner = view.landmarks, view.photo, _landmark_partners(generic)
    flipped = landmarks.points * [-1, 1] + [photo.size[0], 0]
    names = list(BLENDSHAPE_NAMES)
    swapped = [
        names.index(_other_side(name)) if _other_side(name) in names else k
        for k, name in enumerate(names)
    ]
    pixels = np.ascontiguousarray(photo.pixels[:, ::-1])
    return replace(
        view,
        photo=replace(photo, pixels=pixels),
        landmarks=replace(
            landmarks,
            points=flipped[partner],
            confidence=landmarks.confidence[partner],
            blendshapes=landmarks.blendshapes[swapped],
            R_cam_head=_FLIP @ landmarks.R_cam_head @ _FLIP,
        ),
    )


def _mirrored_camera(camera: Camera) -> Camera:
    """That of the photo turned over, of a head that is its own mirror image."""
    return replace(
        camera,
        R_cam_head=_FLIP @ camera.R_cam_head @ _FLIP,
        t_cam_head=_FLIP @ camera.t_cam_head,
        principal_px=camera.principal * [-1, 1] + [camera.width, 0],
    )


def _shared(
    view: CapturedView,
    camera: Camera,
    others: Sequence[int],
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    mesh: Mesh,
) -> int:
    """How many points a photo shares with those that look from nearest to it."""
    nearest = sorted(others, key=lambda j: degrees_between(camera, cameras[j]))[:_NEIGHBOURS]
    return sum(count_shared((view, views[j]), (camera, cameras[j]), mesh) for j in nearest)


def _landmark_partners(generic: GenericHead) -> Int[Array, " 478"]:
    """(478,) each landmark's left-right partner: they lie on the generic head symmetrically."""
    places = generic.landmark_positions(generic.mesh.vertices)
    return np.asarray(cKDTree(places).query(places * [-1, 1, 1])[1])


def _other_side(unit: str) -> str:
    if unit.endswith("Left"):
        return unit.removesuffix("Left") + "Right"
    return unit.removesuffix("Right") + "Left" if unit.endswith("Right") else unit
