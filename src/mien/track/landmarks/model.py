"""What a landmark detector means by its landmarks on one head.

They lie off the places that they are attached to on the generic head, by 4 to 9 % of the distance
between the eyes on real heads and in every expression differently; but whether the detector looks
at a person or at a picture of that person's head makes little difference, 1.2 to 2.6 %. So it is
shown such pictures once, and what it says of them is what it means.
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
from mien.track.landmarks.detector_bias import Meant, Pictures, at_landmarks, landmark_normals
from mien.track.state import Layout

REPEATED_MM = 0.8
"""How far, each axis, a detector finds a landmark in a photograph off where it does in a picture
of the head that the photograph shows."""
UNSEEN_MM = 2.5
"""The same where no such picture tells what it means."""
_EXPRESSION_VIEWS = 3
"""Expressions are shown from fewer sides than the neutral face, and units from the front alone."""


@dataclass(frozen=True)
class Marks:
    """The detector's landmarks on one head, and how P unknowns of its face move them.

    The unknowns are the weights of all expressions but neutral, region after region, then those of
    the units.

    Attributes:
        places: (478, 3) mm, head space, in the neutral face.
        drift: (3, 478, 3) mm by which they move with each of the numbers of a viewpoint.
        normals: (478, 3) of its surface there.
        moves: (P, 478, 3) mm, at weight 1.
        sigma_mm: (478,) how far off its place each is found, each axis; inf where it has none.
        scores: (52,) what the detector says of the neutral face's units.
        score_moves: (P, 52) by which that changes at weight 1.
    """

    places: Float[Array, "478 3"]
    drift: Float[Array, "3 478 3"]
    normals: Float[Array, "478 3"]
    moves: Float[Array, "p 478 3"]
    sigma_mm: Float[Array, " 478"]
    scores: Float[Array, " 52"]
    score_moves: Float[Array, "p 52"]


def measure_marks(rig: Rig, mesh: Mesh, layout: Layout, pictures: Pictures) -> Marks:
    """The landmarks of a head by showing the detector pictures of it, 15 ms each.

    Where it finds no face in them, landmarks stay where the generic head has them.

    Args:
        rig: poses the head.
        mesh: the head's own, in its neutral face.
        pictures: of it.

    Raises:
        InputError: a region, expression or unit that the head has not.
    """
    generic = load_generic_head()
    neutral = pictures.meant(FaceState())
    drift = neutral.drift
    in_front = pictures.meant(FaceState(), 1, drift)
    expressions = [
        pictures.meant(FaceState({FACE: {name: 1.0}}), _EXPRESSION_VIEWS, drift)
        for name in layout.expressions[1:]
    ]
    units = [pictures.meant(FaceState(units={name: 1.0}), 1, drift) for name in layout.units]
    masks = np.array([rig.mask(region) for region in layout.regions])
    nearby, concerned = at_landmarks(generic, masks.T).T, _of_scores(generic, masks)
    changes = [meant.change_from(neutral) for meant in expressions]
    moves = [near[:, None] * move for near in nearby for move, _ in changes]
    score_moves = [share * score for share in concerned for _, score in changes]
    for meant in units:
        move, score = meant.change_from(in_front)
        moves.append(move)
        score_moves.append(score)
    return Marks(
        places=frozen(neutral.attached + neutral.beside),
        drift=frozen(drift),
        normals=frozen(landmark_normals(generic, mesh)),
        moves=frozen(np.reshape(moves, (-1, LANDMARK_COUNT, 3))),
        sigma_mm=frozen(_sigma(generic, [neutral, *expressions])),
        scores=frozen(neutral.scores),
        score_moves=frozen(np.reshape(score_moves, (-1, len(BLENDSHAPE_NAMES)))),
    )


def _of_scores(generic: GenericHead, masks: Float[Array, "r v"]) -> Float[Array, "r 52"]:
    """(R, 52) the share of each scored unit's movement that lies in each region."""
    moved = np.linalg.norm(generic.unit_offsets, axis=2)
    by_unit = masks @ moved.T / np.maximum(moved.sum(axis=1), 1e-9)
    column = {name: by_unit[:, index] for index, name in enumerate(generic.unit_names)}
    return np.stack([column.get(name, np.zeros(len(masks))) for name in BLENDSHAPE_NAMES], axis=1)


def _sigma(generic: GenericHead, meants: Sequence[Meant]) -> Float[Array, " 478"]:
    """(478,) mm: how far landmarks stray from view to view, and from picture to photograph."""
    misses = np.concatenate([meant.misses for meant in meants if meant.seen] or [_NOTHING])
    seen = np.isfinite(misses[..., 0])
    strayed = np.nansum(misses**2, axis=(0, 2)) / np.maximum(2 * seen.sum(axis=0), 1)
    sigma = np.where(seen.any(axis=0), np.sqrt(REPEATED_MM**2 + strayed), UNSEEN_MM)
    return np.where(generic.landmark_attached, sigma, np.inf)


_NOTHING = np.zeros((0, LANDMARK_COUNT, 2))
