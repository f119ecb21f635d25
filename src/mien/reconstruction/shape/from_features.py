"""A head's shape from its feature points, the cameras fixed.

Source:
    [Pighin 2002] sec. 5.1.2 and 5.1.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.reconstruction.features import Features
from mien.reconstruction.shape.deformation import deform_head
from mien.reconstruction.shape.model import ShapeModel
from mien.reconstruction.triangulation import triangulate

MODEL_SIGMA_MM = 3.0
"""How far a feature lies off the model, its meaning on another face included."""
SEEN_ONCE_SIGMA_MM = 1.0
"""Least standard deviation of a feature that one photo shows: its depth is not measured."""


def shape_from_features(
    features: Features,
    points: Float[Array, "n 3"],
    cameras: Sequence[Camera],
    generic: GenericHead,
    model: ShapeModel,
    *,
    kernel: str = "exponential",
    rounds: int = 2,
) -> Float[Array, "v 3"]:
    """(V, 3) mm: the model as this person, then moved to the features.

    Features observed in several photos come first, since they carry depth. Those observed once are
    then put on their ray at the point nearest to the head, `rounds` times.

    Args:
        features: of K photos.
        points: (N, 3) mm, of the features observed twice.
        cameras: of the photos.
        generic: the generic head.
        model: of what the photos may show.
        kernel: as in fit_rbf.
        rounds: repetitions for features observed once.

    Source:
        [Pighin 2002] sec. 5.1.3, repeated; the model beneath is ours.
    """
    twice = features.observed.sum(axis=0) > 1
    deviation = features.sigma_mm.min(axis=0)
    vertices = model.vertices(estimate_coefficients(features, points, model))
    if twice.any():
        places = features.on(vertices)[twice]
        vertices = deform_head(
            vertices, places, points[twice], generic, deviation_mm=deviation[twice], kernel=kernel
        )
    if twice.all():
        return vertices
    deviation = np.where(twice, deviation, np.maximum(deviation, SEEN_ONCE_SIGMA_MM))
    for _ in range(rounds):
        places = features.on(vertices)
        on_rays = triangulate(cameras, features.image_points, current=places).points
        goals = np.where(twice[:, None], points, on_rays)
        vertices = deform_head(
            vertices, places, goals, generic, deviation_mm=deviation, kernel=kernel
        )
    return vertices


def estimate_coefficients(
    features: Features, points: Float[Array, "n 3"], model: ShapeModel
) -> Float[Array, " c"]:
    """(C,) coefficients of highest posterior given where the features lie.

    Ridge regression: coefficients have deviation 1, features MODEL_SIGMA_MM.
    """
    components = features.on(model.components).reshape(len(model.components), -1)
    offsets = (points - features.on(model.mean)).ravel()
    precision = MODEL_SIGMA_MM**-2
    normal = precision * components @ components.T + np.eye(len(components))
    return np.linalg.solve(normal, precision * components @ offsets)
