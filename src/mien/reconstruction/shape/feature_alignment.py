"""The features of a fitted head moved along its surface to where the photos show them.

Registration finds where the surface is, and hardly where on it the mesh's eyelids and lips lie:
for that there are landmarks. A head whose lids and lips are the person's can be animated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.reconstruction.dense.eyeballs import fit_eyeballs
from mien.reconstruction.features import EDGE_SIGMA_MM, Features
from mien.reconstruction.observations import SurfaceObservations
from mien.reconstruction.shape.skin import deform_skin

EDGE_MM = 1.0
"""How far a landmark on a visible edge lies off it, seen squarely."""
ACROSS_SD_MM = 1.0
"""How far the surface itself may give way where several photos have measured it."""


def align_features(
    vertices: Float[Array, "v 3"],
    features: Features,
    cameras: Sequence[Camera],
    generic: GenericHead,
    *,
    measured: bool,
) -> Float[Array, "v 3"]:
    """The head with eyelids, lips, brows and nose where landmarks show them.

    Args:
        vertices: (V, 3) mm.
        features: of K photos.
        cameras: of K photos.
        generic: the generic head.
        measured: the surface is known from several photos and stays where it is; else what one
            photo shows moves the head across it.
    """
    photo, column = np.nonzero(features.observed & features.on_edges)
    if not len(photo):
        return vertices
    observations = SurfaceObservations(
        corners=features.corners[column],
        barycentrics=features.barycentrics[column],
        offset=np.zeros((len(column), 3)),
        photo=photo,
        image_points=features.image_points[photo, column],
        sigma_mm=features.sigma_mm[photo, column] * EDGE_MM / EDGE_SIGMA_MM,
    )
    held = generic.regions["scalp"]
    across = ACROSS_SD_MM if measured else None
    moved = deform_skin(vertices, observations, cameras, generic, held=held, across_sd_mm=across)
    return fit_eyeballs(moved, generic)
