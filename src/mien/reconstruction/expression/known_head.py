"""What is known of a person before an expression is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.reconstruction.features import EDGE_SIGMA_MM, Features, gather_features
from mien.reconstruction.observations import SurfaceObservations

EXPRESSED_EDGE_MM = 0.8
"""Standard deviation of a landmark on an edge from its known point on this person's head."""
EXPRESSED_SKIN_MM = 2.5
"""The same for one on plain skin, which the detector interpolates from the edges."""
_SHRINKAGE = 1.25
"""Confidence, summed over neutral photos, at which half of a landmark's mean offset is used:
one photo is weak evidence, for landmarks slide from view to view."""


@dataclass(frozen=True)
class KnownHead:
    """A person's neutral head.

    Attributes:
        views: the photos that it was fitted to.
        cameras: the photos that it was fitted to.
        vertices: (V, 3) mm, head space.
        units: (52, V, 3) mm, the face units of this head.
    """

    views: Sequence[CapturedView]
    cameras: Sequence[Camera]
    vertices: Float[Array, "v 3"]
    units: Float[Array, "52 v 3"]
    generic: GenericHead


def feature_observations(features: Features, known: KnownHead) -> SurfaceObservations:
    """Landmarks and marks of an expression's photos, less their offsets in the neutral ones.

    A landmark lies at a point that differs from person to person, but hardly between a person's
    expressions: where the neutral photos show it off its attachment, the others do, too.
    """
    # Irises lie on the eyeballs, which turn by themselves.
    on_face = known.generic.regions["face"][features.corners].max(axis=1) > 0
    photo, column = np.nonzero(features.observed & (on_face | features.by_hand))
    offset = _offset(features, known)
    landmark = ~features.by_hand[photo, column]
    on_edge = features.sigma_mm[photo, column] <= 2 * EDGE_SIGMA_MM
    sigma = np.where(on_edge, EXPRESSED_EDGE_MM, EXPRESSED_SKIN_MM)
    return SurfaceObservations(
        corners=features.corners[column],
        barycentrics=features.barycentrics[column],
        offset=offset[column],
        photo=photo,
        image_points=features.image_points[photo, column],
        sigma_mm=np.where(landmark, sigma, features.sigma_mm[photo, column]),
    )


def _offset(features: Features, known: KnownHead) -> Float[Array, "n 3"]:
    """(N, 3) mm, by which the neutral photos show each landmark off its place, on average."""
    seen = gather_features(known.views, known.generic)
    column_name = {name: column for column, name in enumerate(seen.names)}
    total, weight = np.zeros((len(seen.names), 3)), np.zeros(len(seen.names))
    points = seen.on(known.vertices)
    for k, camera in enumerate(known.cameras):
        off = seen.image_points[k] - camera.project(points)
        mm_per_px = camera.to_camera(points)[:, 2] / camera.focal_px
        usable = seen.observed[k] & ~seen.by_hand[k]
        confidence = np.where(usable, EDGE_SIGMA_MM / seen.sigma_mm[k], 0.0)
        moved = (off * mm_per_px[:, None]) @ camera.R_cam_head[:2]
        total[usable] += (confidence[:, None] * moved)[usable]
        weight += confidence
    mean = total / (weight + _SHRINKAGE)[:, None]
    offset = np.zeros((len(features.names), 3))
    for n, name in enumerate(features.names):
        if name in column_name:
            offset[n] = mean[column_name[name]]
    return offset
