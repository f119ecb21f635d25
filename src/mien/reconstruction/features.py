"""Feature points: places on the head's surface and where the photos show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Bool, Float, Int
from mien.assets.generic import GenericHead
from mien.assets.landmark_sets import FACE_OVAL, ON_EDGES
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.errors import InputError
from mien.reconstruction.curves import match_curve, resample_curve

POINT_SIGMA_MM = 0.5
"""How well a person places a named point (about 1 px where a face fills a 2-megapixel photo)."""
CURVE_SIGMA_MM = 1.0
"""Standard deviation of a point along a drawn curve."""
EDGE_SIGMA_MM = 2.5
"""How far a landmark on an eye, brow, lip or the nose slides over the skin between views."""
SKIN_SIGMA_MM = 12.0
"""The same for one on plain skin, which the detector interpolates (docs/method/cameras.md)."""
MIN_CONFIDENCE = 0.1
"""Landmarks below are not used: the surface turns away there."""
MIN_NAMED_POINTS = 8
"""With so many named points in a photo its camera is found without its curves."""
MARK_RADIUS_MM = 25.0
"""Landmarks of a photo this near to its hand-made marks are dropped."""


@dataclass(frozen=True)
class Features:
    """N points on the mesh, observed in K photos.

    Attributes:
        names: (N) point, POLYLINE.INDEX, or landmark number.
        corners: (N, 3) vertices of the triangle that holds the place.
        barycentrics: (N, 3) in it.
        image_points: (K, N, 2) px, NaN where unseen.
        sigma_mm: (K, N) standard deviation of the observation on the surface; inf where unseen.
        by_hand: (K, N) True for a mark that a person made.
    """

    names: tuple[str, ...]
    corners: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]
    image_points: Float[Array, "k n 2"]
    sigma_mm: Float[Array, "k n"]
    by_hand: Bool[Array, "k n"]

    @property
    def observed(self) -> Bool[Array, "k n"]:
        """(K, N) where a photo shows a feature."""
        return np.asarray(np.isfinite(self.sigma_mm))

    @property
    def on_edges(self) -> Bool[Array, " n"]:
        """(N,) landmarks on a visible edge."""
        return np.isin(self.names, [f"landmark {number}" for number in ON_EDGES])

    def on(self, vertices: Float[Array, "... v 3"]) -> Float[Array, "... n 3"]:
        """Where the features lie on a head (or on each of a stack of offset fields), mm."""
        return np.einsum("nc,...ncd->...nd", self.barycentrics, vertices[..., self.corners, :])

    def sigma_px(self, cameras: Sequence[Camera]) -> Float[Array, "k n"]:
        """(K, N) px: the observations' deviations as these cameras see them; inf where unseen."""
        px_per_mm = [camera.focal_px / camera.t_cam_head[2] for camera in cameras]
        return self.sigma_mm * np.array(px_per_mm)[:, None]

    def of_photos(self, keep: Bool[Array, " k"]) -> Features:
        """Only these photos; features that none of them shows are dropped."""
        image, sigma = self.image_points[keep], self.sigma_mm[keep]
        used: Array = np.asarray(np.isfinite(sigma).any(axis=0))
        return Features(
            names=tuple(name for name, use in zip(self.names, used, strict=True) if use),
            corners=self.corners[used],
            barycentrics=self.barycentrics[used],
            image_points=image[:, used],
            sigma_mm=sigma[:, used],
            by_hand=self.by_hand[keep][:, used],
        )


def gather_features(views: Sequence[CapturedView], generic: GenericHead) -> Features:
    """Hand-made marks and curves of all photos, and landmarks where those are silent.

    Drawn curves become points by arc length; `rematch_curves` improves on that once cameras are
    known. A point marked by name wins over the curve through it.
    """
    columns = _columns(generic)
    # The face oval runs along the silhouette, wherever that is: no place on the surface.
    steady = ~np.isin(np.arange(478), list(FACE_OVAL))
    landmarks = np.flatnonzero(generic.landmark_attached & steady)
    slide = np.where(np.isin(landmarks, list(ON_EDGES)), EDGE_SIGMA_MM, SKIN_SIGMA_MM)
    vertices = list(columns)
    image = np.full((len(views), len(vertices) + len(landmarks), 2), np.nan)
    sigma = np.full(image.shape[:2], np.inf)
    for k, view in enumerate(views):
        for vertex, point in _curve_points(view, generic).items():
            image[k, columns[vertex]], sigma[k, columns[vertex]] = point, CURVE_SIGMA_MM
        for name, point in (view.annotations.points if view.annotations else {}).items():
            column = columns[generic.vertex_of(name)]
            image[k, column], sigma[k, column] = point, POINT_SIGMA_MM
        if view.landmarks is not None:
            confidence = view.landmarks.confidence[landmarks]
            image[k, len(vertices) :] = view.landmarks.points[landmarks]
            sigma[k, len(vertices) :] = np.where(
                confidence > MIN_CONFIDENCE,
                slide / np.maximum(confidence, MIN_CONFIDENCE),
                np.inf,
            )
    first_corner = np.tile([1.0, 0.0, 0.0], (len(vertices), 1))
    features = Features(
        names=(*_names(generic, vertices), *(f"landmark {number}" for number in landmarks)),
        corners=np.concatenate(
            [
                np.repeat(np.array(vertices)[:, None], 3, axis=1),
                generic.mesh.triangles[generic.landmark_triangles[landmarks]],
            ]
        ),
        barycentrics=np.concatenate([first_corner, generic.landmark_barycentrics[landmarks]]),
        image_points=image,
        sigma_mm=sigma,
        by_hand=np.isfinite(sigma) & (np.arange(image.shape[1]) < len(vertices)),
    )
    return _drop_landmarks_near_marks(features, generic).of_photos(np.ones(len(views), bool))


def image_points_for_cameras(features: Features) -> Float[Array, "k n 2"]:
    """(K, N, 2) px, NaN for points of drawn curves in photos that have enough named ones.

    Until cameras are known a curve's points are placed by arc length, which foreshortening
    falsifies; [Pighin 2002] (sec. 5.1.3) leaves them out of the pose for the same reason.
    """
    drawn = features.by_hand & (features.sigma_mm == CURVE_SIGMA_MM)
    named = features.by_hand & ~drawn
    enough = named.sum(axis=1) >= MIN_NAMED_POINTS
    return np.where((drawn & enough[:, None])[..., None], np.nan, features.image_points)


def rematch_curves(
    features: Features,
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    generic: GenericHead,
) -> Features:
    """Points of the drawn curves moved along them to where the epipolar lines say.

    For each curve the photo whose points were marked most squarely, the one that shows it longest
    in pixels, serves as the reference; the others follow it.

    Source:
        [Pighin 2002] 5.1.3.
    """
    image = features.image_points.copy()
    columns = {int(a): n for n, (a, b, _) in enumerate(features.corners) if a == b}
    for name, vertices in generic.polylines.items():
        drawn = {
            k: view.annotations.curves[name]
            for k, view in enumerate(views)
            if view.annotations and name in view.annotations.curves
        }
        if len(drawn) < 2:
            continue
        reference = max(drawn, key=lambda k: _length(drawn[k]) / cameras[k].focal_px)
        places = _fractions(generic, name)
        points = resample_curve(drawn[reference], places)
        for k, curve in drawn.items():
            if k == reference:
                continue
            matched = match_curve(points, cameras[reference], curve, cameras[k], fractions=places)
            for vertex, point in zip(vertices, matched.points, strict=True):
                column = columns[vertex]
                if features.sigma_mm[k, column] == CURVE_SIGMA_MM:
                    image[k, column] = point
    return replace(features, image_points=image)


def _columns(generic: GenericHead) -> dict[int, int]:
    """A column for every vertex that has a name; an eye's corner, say, has several."""
    vertices = dict.fromkeys(generic.vertex_of(name) for name in generic.feature_names)
    return {vertex: column for column, vertex in enumerate(vertices)}


def _names(generic: GenericHead, vertices: list[int]) -> list[str]:
    named: dict[int, str] = {}
    for name in generic.feature_names:
        named.setdefault(generic.vertex_of(name), name)
    return [named[vertex] for vertex in vertices]


def _curve_points(view: CapturedView, generic: GenericHead) -> dict[int, Float[Array, " 2"]]:
    """Every drawn curve's points by arc length, by vertex of its polyline."""
    points: dict[int, Float[Array, " 2"]] = {}
    for name, curve in (view.annotations.curves if view.annotations else {}).items():
        try:
            along = resample_curve(curve, _fractions(generic, name))
        except InputError as error:
            raise InputError(
                f"{view.photo.name}: curves.{name}", error.expected, error.got
            ) from None
        points.update(zip(generic.polylines[name], along, strict=True))
    return points


def _fractions(generic: GenericHead, name: str) -> Float[Array, " n"]:
    """Arc-length positions in [0, 1] of a polyline's vertices on the generic head."""
    line = generic.mesh.vertices[list(generic.polylines[name])]
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    return lengths / lengths[-1]


def _length(curve: Float[Array, "m 2"]) -> float:
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def _drop_landmarks_near_marks(features: Features, generic: GenericHead) -> Features:
    places = features.on(generic.mesh.vertices)
    landmark = np.char.startswith(features.names, "landmark")
    sigma = features.sigma_mm.copy()
    for k, hand in enumerate(features.by_hand):
        if hand.any():
            distance = cKDTree(places[hand]).query(places)[0]
            sigma[k, landmark & (distance < MARK_RADIUS_MM)] = np.inf
    image = np.where(np.isfinite(sigma)[..., None], features.image_points, np.nan)
    return replace(features, image_points=image, sigma_mm=sigma)
