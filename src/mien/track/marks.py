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
from mien.camera import Camera
from mien.capture.detector import LandmarkDetector
from mien.capture.mediapipe_face import BLENDSHAPE_NAMES, LANDMARK_COUNT, DetectedFace
from mien.expressions.rig import Rig
from mien.expressions.state import FACE, FaceState
from mien.mesh import Mesh
from mien.render.morph import MorphRenderer
from mien.render.orbit import orbit_camera
from mien.render.picture import GREY
from mien.track.state import Layout

REPEATED_MM = 0.8
"""How far, each axis, a detector finds a landmark in a photograph off where it does in a picture
of the head that the photograph shows."""
UNSEEN_MM = 2.5
"""The same where no such picture tells what it means."""
_VIEWS = np.radians([[0.0, 0.0], [-20.0, 8.0], [20.0, 8.0]])
"""Yaw and pitch of the cameras that expressions are shown by; units by the first alone."""
_SIZE, _FOV = (320, 400), np.radians(35.0)
_HELD = 0.1
"""How firmly a landmark is held in its place, to one view's say: along the line of sight."""


@dataclass(frozen=True)
class Marks:
    """The detector's landmarks on one head, and how P unknowns of its face move them.

    The unknowns are the weights of all expressions but neutral, region after region, then those of
    the units.

    Attributes:
        places: (478, 3) mm, head space, in the neutral face.
        normals: (478, 3) of its surface there.
        moves: (P, 478, 3) mm, at weight 1.
        sigma_mm: (478,) how far off its place each is found, each axis; inf where it has none.
        scores: (52,) what the detector says of the neutral face's units.
        score_moves: (P, 52) by which that changes at weight 1.
    """

    places: Float[Array, "478 3"]
    normals: Float[Array, "478 3"]
    moves: Float[Array, "p 478 3"]
    sigma_mm: Float[Array, " 478"]
    scores: Float[Array, " 52"]
    score_moves: Float[Array, "p 52"]


@dataclass(frozen=True)
class Sight:
    """What a detector says of a picture by a camera that is known."""

    camera: Camera
    face: DetectedFace


@dataclass(frozen=True)
class Meant:
    """What a detector means by its landmarks on a face in one state.

    Attributes:
        attached: (478, 3) mm, where the generic head has them.
        beside: (478, 3) mm, by which the detector has them elsewhere.
        misses: (V, 478, 2) mm by which each of V pictures has them elsewhere still; NaN where the
            surface turns away.
        scores: (52,) of units.
    """

    attached: Float[Array, "478 3"]
    beside: Float[Array, "478 3"]
    misses: Float[Array, "v 478 2"]
    scores: Float[Array, " 52"]

    @property
    def seen(self) -> bool:
        """False where the detector found no face in any picture."""
        return len(self.misses) > 0

    def change_from(self, other: Meant) -> tuple[Float[Array, "478 3"], Float[Array, " 52"]]:
        """How landmarks, mm, and scores differ from those of another state of the same face."""
        change = self.attached - other.attached
        if not (self.seen and other.seen):
            return change, np.zeros_like(self.scores)
        return change + self.beside - other.beside, self.scores - other.scores


def measure_marks(rig: Rig, mesh: Mesh, layout: Layout, detector: LandmarkDetector) -> Marks:
    """The landmarks of a head by showing the detector pictures of it, 15 ms each.

    Where it finds no face in them, landmarks stay where the generic head has them.

    Args:
        rig: poses the head. mesh: the head's own, in its neutral face.
    Raises: InputError: a region, expression or unit that the head has not.
    """
    generic = load_generic_head()
    asked = _Pictures(rig, mesh, generic, detector)
    neutral, in_front = asked.meant(FaceState()), asked.meant(FaceState(), views=1)
    expressions = [asked.meant(FaceState({FACE: {name: 1.0}})) for name in layout.expressions[1:]]
    units = [asked.meant(FaceState(units={name: 1.0}), views=1) for name in layout.units]
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
        normals=frozen(landmark_normals(generic, mesh)),
        moves=frozen(np.reshape(moves, (-1, LANDMARK_COUNT, 3))),
        sigma_mm=frozen(_sigma(generic, [neutral, *expressions])),
        scores=frozen(neutral.scores),
        score_moves=frozen(np.reshape(score_moves, (-1, len(BLENDSHAPE_NAMES)))),
    )


def places_meant(
    attached: Float[Array, "478 3"], normals: Float[Array, "478 3"], sights: Sequence[Sight]
) -> Meant:
    """Where the landmarks lie so that all pictures of one face agree best.

    Each is held lightly where it is attached, for what the pictures do not tell: how near it is.

    Args:
        attached: (478, 3) mm. normals: (478, 3) there. sights: none or some of one face.
    """
    held = _HELD * np.eye(3)
    matrix, right = np.tile(held, (len(attached), 1, 1)), np.zeros_like(attached)
    misses = np.full((len(sights), len(attached), 2), np.nan)
    weights = [facing(sight.camera, attached, normals) for sight in sights]
    for row, (sight, weight) in enumerate(zip(sights, weights, strict=True)):
        camera = sight.camera
        mm_per_px = camera.to_camera(attached)[:, 2:] / camera.focal_px
        misses[row] = (sight.face.points[:, :2] - camera.project(attached)) * mm_per_px
        across = camera.R_cam_head[:2]
        matrix += weight[:, None, None] * (across.T @ across)
        right += weight[:, None] * (misses[row] @ across)
    beside = np.linalg.solve(matrix, right[..., None])[..., 0]
    for row, (sight, weight) in enumerate(zip(sights, weights, strict=True)):
        misses[row] -= beside @ sight.camera.R_cam_head[:2].T
        misses[row, weight == 0] = np.nan
    scores = [sight.face.blendshapes for sight in sights]
    return Meant(attached, beside, misses, np.mean(scores, axis=0) if scores else np.zeros(52))


def facing(
    camera: Camera, places: Float[Array, "n 3"], normals: Float[Array, "n 3"]
) -> Float[Array, " n"]:
    """(N,) in [0, 1]: how far to trust landmarks at these places, mm, of a surface."""
    towards = camera.center - places
    return facing_share((normals * towards).sum(axis=1) / np.linalg.norm(towards, axis=1))


def facing_share(cosine: Float[Array, " n"]) -> Float[Array, " n"]:
    """(N,) of the angle between normal and view: the ramp of landmarks.facing_confidence."""
    share: Array = np.clip((cosine - 0.1) / 0.8, 0.0, 1.0)
    return share


class _Pictures:
    """Shows pictures of one head to a detector."""

    def __init__(
        self, rig: Rig, mesh: Mesh, generic: GenericHead, detector: LandmarkDetector
    ) -> None:
        self._rig, self._mesh, self._generic, self._detector = rig, mesh, generic, detector
        self._renderer = MorphRenderer(mesh, rig.textures)
        width, height = _SIZE
        self._cameras = [
            orbit_camera(yaw, pitch, width=width, height=height, vertices=mesh.vertices, fov=_FOV)
            for yaw, pitch in _VIEWS
        ]

    def meant(self, state: FaceState, *, views: int = len(_VIEWS)) -> Meant:
        """What the detector means by its landmarks on the head in this state."""
        face = self._rig.evaluate(state)
        sights = []
        for camera in self._cameras[:views]:
            picture = self._renderer.render(face, camera, samples=1, background=GREY)
            found = self._detector.detect_fast(np.ascontiguousarray(picture[..., :3]))
            if found is not None:
                sights.append(Sight(camera, found))
        posed = self._mesh.with_vertices(face.vertices)
        attached = self._generic.landmark_positions(face.vertices)
        return places_meant(attached, landmark_normals(self._generic, posed), sights)


def landmark_normals(generic: GenericHead, mesh: Mesh) -> Float[Array, "478 3"]:
    """(478, 3) unit normals of a head's surface at the places of the landmarks."""
    normals = at_landmarks(generic, mesh.vertex_normals())
    unit: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return unit


def at_landmarks(generic: GenericHead, values: Float[Array, "*k v c"]) -> Float[Array, "*k 478 c"]:
    """What vertices have, (..., V, C), at the places of the landmarks."""
    corners = generic.mesh.triangles[generic.landmark_triangles]
    at: Array = np.einsum(
        "lc,...lcd->...ld", generic.landmark_barycentrics, values[..., corners, :]
    )
    return at


def _of_scores(generic: GenericHead, masks: Float[Array, "r v"]) -> Float[Array, "r 52"]:
    """(R, 52) the share of each scored unit's movement that lies in each region."""
    moved = np.linalg.norm(generic.unit_offsets, axis=2)
    by_unit = masks @ moved.T / np.maximum(moved.sum(axis=1), 1e-9)
    column = {name: by_unit[:, index] for index, name in enumerate(generic.unit_names)}
    shares: Array = np.stack(
        [column.get(name, np.zeros(len(masks))) for name in BLENDSHAPE_NAMES], axis=1
    )
    return shares


def _sigma(generic: GenericHead, meants: Sequence[Meant]) -> Float[Array, " 478"]:
    """(478,) mm: how far landmarks stray from view to view, and from picture to photograph."""
    misses = np.concatenate([meant.misses for meant in meants if meant.seen] or [_NOTHING])
    seen = np.isfinite(misses[..., 0])
    strayed = np.nansum(misses**2, axis=(0, 2)) / np.maximum(2 * seen.sum(axis=0), 1)
    sigma = np.where(seen.any(axis=0), np.sqrt(REPEATED_MM**2 + strayed), UNSEEN_MM)
    return np.where(generic.landmark_attached, sigma, np.inf)


_NOTHING = np.zeros((0, LANDMARK_COUNT, 2))
