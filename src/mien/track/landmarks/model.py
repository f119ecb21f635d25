"""Where a landmark detector finds its landmarks on one head.

On real heads they lie 4 to 9 % of the distance between the eyes from the surface points that the
generic head assigns to them, in every expression differently. In a photograph of a person and in a
rendered picture of that person's head the detector finds nearly the same points: they differ by
1.2 to 2.6 %. So its bias is measured once, in rendered pictures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.assets.generic import GenericHead, load_generic_head
from mien.assets.landmark_sets import LANDMARK_COUNT
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.mesh import Mesh
from mien.rig.rig import Rig
from mien.rig.state import FACE, FaceState
from mien.track.landmarks.detector_bias import (
    DetectorBias,
    DetectorProbe,
    at_landmarks,
    landmark_normals,
)
from mien.track.state import Layout

LANDMARK_SD_MM = 0.8
"""Standard deviation, each axis, of a landmark in a photograph from the same one in a rendered
picture of the head that the photograph shows."""
UNMEASURED_SD_MM = 2.5
"""The same where the bias could not be measured."""
_EXPRESSION_VIEWS = 3
"""Expressions are rendered from fewer viewpoints than the neutral face, units from one."""


@dataclass(frozen=True)
class LandmarkModel:
    """The detector's landmarks on one head, linear in P unknowns of its face.

    The unknowns are the weights of all expressions but neutral, region after region, then those of
    the units.

    Attributes:
        positions: (478, 3) mm, head space, in the neutral face.
        view_slopes: (3, 478, 3) mm by which they move with each viewpoint coordinate.
        normals: (478, 3) of the surface there.
        offsets: (P, 478, 3) mm by which each unknown moves them at 1.
        sigma_mm: (478,) standard deviations, each axis; inf of landmarks without a surface point.
        scores: (52,) the detector's of the neutral face.
        score_offsets: (P, 52) by which each unknown changes them at 1.
    """

    positions: Float[Array, "478 3"]
    view_slopes: Float[Array, "3 478 3"]
    normals: Float[Array, "478 3"]
    offsets: Float[Array, "p 478 3"]
    sigma_mm: Float[Array, " 478"]
    scores: Float[Array, " 52"]
    score_offsets: Float[Array, "p 52"]


def build_landmark_model(
    rig: Rig, mesh: Mesh, layout: Layout, probe: DetectorProbe
) -> LandmarkModel:
    """The landmarks of a head, measured in rendered pictures of it, 15 ms each.

    Where no face is detected in them, landmarks stay at the generic head's surface points.

    Args:
        rig: of the head.
        mesh: the head's, in its neutral face.
        layout: whose expressions and units are the unknowns.
        probe: of the head.

    Raises:
        InputError: a region, expression or unit that the head has not.
    """
    generic = load_generic_head()
    neutral = probe.measure_bias(FaceState())
    view_slopes = neutral.view_slopes
    frontal = probe.measure_bias(FaceState(), 1, view_slopes)
    expressions = [
        probe.measure_bias(FaceState({FACE: {name: 1.0}}), _EXPRESSION_VIEWS, view_slopes)
        for name in layout.expressions[1:]
    ]
    units = [
        probe.measure_bias(FaceState(units={name: 1.0}), 1, view_slopes) for name in layout.units
    ]
    masks = np.array([rig.mask(region) for region in layout.regions])
    region_weights = at_landmarks(generic, masks.T).T
    score_shares = _region_shares_of_scores(generic, masks)
    changes = [bias.change_from(neutral) for bias in expressions]
    offsets = [weight[:, None] * offset for weight in region_weights for offset, _ in changes]
    score_offsets = [share * score for share in score_shares for _, score in changes]
    for bias in units:
        offset, score = bias.change_from(frontal)
        offsets.append(offset)
        score_offsets.append(score)
    return LandmarkModel(
        positions=frozen(neutral.positions + neutral.offsets),
        view_slopes=frozen(view_slopes),
        normals=frozen(landmark_normals(generic, mesh)),
        offsets=frozen(np.reshape(offsets, (-1, LANDMARK_COUNT, 3))),
        sigma_mm=frozen(_sigma(generic, [neutral, *expressions])),
        scores=frozen(neutral.scores),
        score_offsets=frozen(np.reshape(score_offsets, (-1, len(BLENDSHAPE_NAMES)))),
    )


def _region_shares_of_scores(
    generic: GenericHead, masks: Float[Array, "r v"]
) -> Float[Array, "r 52"]:
    """(R, 52) the share of each scored unit's motion that lies in each region."""
    moved = np.linalg.norm(generic.unit_offsets, axis=2)
    shares = masks @ moved.T / np.maximum(moved.sum(axis=1), 1e-9)
    column = {name: shares[:, index] for index, name in enumerate(generic.unit_names)}
    return np.stack([column.get(name, np.zeros(len(masks))) for name in BLENDSHAPE_NAMES], axis=1)


def _sigma(generic: GenericHead, biases: Sequence[DetectorBias]) -> Float[Array, " 478"]:
    """(478,) mm: deviation from view to view, and from rendered picture to photograph."""
    residuals = np.concatenate(
        [bias.residuals for bias in biases if bias.detected] or [np.zeros((0, LANDMARK_COUNT, 2))]
    )
    measured = np.isfinite(residuals[..., 0])
    variance = np.nansum(residuals**2, axis=(0, 2)) / np.maximum(2 * measured.sum(axis=0), 1)
    sigma = np.where(measured.any(axis=0), np.sqrt(LANDMARK_SD_MM**2 + variance), UNMEASURED_SD_MM)
    return np.where(generic.landmark_attached, sigma, np.inf)
