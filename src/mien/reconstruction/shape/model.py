"""The morphable model that photos of one expression are fitted with: identity and face units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.source import CapturedView

UNIT_SD, UNIT_SD_PER_SCORE = 0.05, 0.3
"""Standard deviation of a unit's weight from the detector's score: of a score of 0, and what is
added for a score of 1. What the detector does not see is hardly there."""
_UNOBSERVED = ("eyeLook", "tongueOut")
"""Units without landmarks."""


@dataclass(frozen=True)
class ShapeModel:
    """vertices = mean + coefficients . components, the coefficients independent with deviation 1.

    Attributes:
        mean: (V, 3) mm.
        components: (C, V, 3) mm.
    """

    mean: Float[Array, "v 3"]
    components: Float[Array, "c v 3"]

    def vertices(self, coefficients: Float[Array, " c"]) -> Float[Array, "v 3"]:
        """(V, 3) mm of the head with these coefficients."""
        return self.mean + np.tensordot(coefficients, self.components, 1)


def shape_model(views: Sequence[CapturedView], generic: GenericHead) -> ShapeModel:
    """Heads that photos of one expression may show: any person, with nearly that expression.

    Without face units a laugh would be taken for perspective: a wide mouth seen from near.

    Args:
        views: the photos, all of the same expression.
        generic: the generic head.

    Source:
        Blanz and Vetter, A Morphable Model for the Synthesis of 3D Faces, 1999; the units have the
        detector's scores as their prior.
    """
    found = [view.landmarks.blendshapes for view in views if view.landmarks is not None]
    if not found:
        return ShapeModel(generic.mesh.vertices, generic.identity.components)
    scores = dict(zip(BLENDSHAPE_NAMES, np.mean(found, axis=0), strict=True))
    used = [k for k, name in enumerate(generic.unit_names) if not name.startswith(_UNOBSERVED)]
    expected = np.array([scores[generic.unit_names[k]] for k in used])
    deviation = UNIT_SD + UNIT_SD_PER_SCORE * expected
    units = generic.unit_offsets[used]
    return ShapeModel(
        generic.mesh.vertices + np.tensordot(expected, units, 1),
        np.concatenate([generic.identity.components, deviation[:, None, None] * units]),
    )
