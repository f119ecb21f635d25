"""Where a landmark detector sees its landmarks on a head that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES, DetectedFace
from mien.mesh import Mesh
from mien.numeric.rotation import cross_matrix
from mien.render.morph import MorphRenderer
from mien.render.orbit import orbit_camera
from mien.render.picture import GREY
from mien.rig.rig import Rig
from mien.rig.state import FaceState, PosedFace

_VIEWS = np.radians(
    [
        [0.0, 0.0, 35.0],
        [-20.0, 8.0, 35.0],
        [20.0, 8.0, 35.0],
        [-28.0, -6.0, 35.0],
        [28.0, -6.0, 35.0],
        [0.0, 16.0, 35.0],
        [0.0, -14.0, 35.0],
        [0.0, 0.0, 65.0],
        [0.0, 0.0, 18.0],
    ]
)
"""Yaw, pitch and angle of view of the cameras that a face is shown by."""
ALL_VIEWS = len(_VIEWS)
_SIZE, _LONGEST = (320, 400), 640
_HELD = 0.03
"""How firmly a landmark is held in its place, to one view's say: what views do not tell."""
_USUAL_MM = 600.0


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
        drift: (3, 478, 3) mm, by which that changes with the viewpoint.
        misses: (V, 478, 2) mm by which each of V pictures has them elsewhere still; NaN where the
            surface turns away.
        scores: (52,) of units.
    """

    attached: Float[Array, "478 3"]
    beside: Float[Array, "478 3"]
    drift: Float[Array, "3 478 3"]
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


class Pictures:
    """Shows pictures of one head to a detector.

    Args:
        rig: poses the head.
        mesh: the head's own, in its neutral face.
    """

    def __init__(self, rig: Rig, mesh: Mesh, detector: LandmarkDetector) -> None:
        self._rig, self._mesh, self._detector = rig, mesh, detector
        self._renderer = MorphRenderer(mesh, rig.textures)
        width, height = _SIZE
        self._cameras = [
            orbit_camera(yaw, pitch, width=width, height=height, vertices=mesh.vertices, fov=fov)
            for yaw, pitch, fov in _VIEWS.tolist()
        ]

    def show(self, state: FaceState, camera: Camera) -> DetectedFace | None:
        """What the detector finds in the picture that a camera would take, in that one's px."""
        return self._show(self._rig.evaluate(state), camera)

    def _show(self, face: PosedFace, camera: Camera) -> DetectedFace | None:
        factor = min(1.0, _LONGEST / max(camera.width, camera.height))
        picture = self._renderer.render(face, camera.resized(factor), samples=1, background=GREY)
        found = self._detector.detect_fast(np.ascontiguousarray(picture[..., :3]))
        return found and replace(found, points=found.points / factor)

    def meant(
        self,
        state: FaceState,
        views: int = ALL_VIEWS,
        drift: Float[Array, "3 478 3"] | None = None,
    ) -> Meant:
        """What the detector means by its landmarks on the head in this state.

        Args:
            views: from how many sides it is shown.
            drift: with the viewpoint, where it is known.
        """
        generic, face = load_generic_head(), self._rig.evaluate(state)
        found = [(camera, self._show(face, camera)) for camera in self._cameras[:views]]
        sights = [Sight(camera, seen) for camera, seen in found if seen is not None]
        attached = generic.landmark_positions(face.vertices)
        normals = landmark_normals(generic, self._mesh.with_vertices(face.vertices))
        return places_meant(attached, normals, sights, drift=drift)


def places_meant(
    attached: Float[Array, "478 3"],
    normals: Float[Array, "478 3"],
    sights: Sequence[Sight],
    *,
    drift: Float[Array, "3 478 3"] | None = None,
) -> Meant:
    """Where the landmarks lie so that all pictures of one face agree best.

    Each is held lightly where it is attached, for what the pictures do not tell.

    Args:
        attached: (478, 3) mm.
        normals: (478, 3) there.
        sights: none or some of one face.
        drift: with the viewpoint, where it is known; found from the pictures otherwise.
    """
    seen_from = [viewpoint(sight.camera.R_cam_head, sight.camera.t_cam_head) for sight in sights]
    features = np.column_stack([np.ones(len(sights)), np.reshape(seen_from, (-1, 3))])
    weights = np.reshape([facing(s.camera, attached, normals) for s in sights], (-1, len(attached)))
    misses = np.reshape([_misses(s, attached) for s in sights], (-1, len(attached), 2))
    across = np.reshape([sight.camera.R_cam_head[:2] for sight in sights], (-1, 2, 3))
    unknown = features
    if drift is not None:
        misses = misses - np.einsum("vf,flc,vac->vla", features[:, 1:], drift, across)
        unknown = features[:, :1]
    places = _regression(misses, weights, across, unknown)
    misses = misses - np.einsum("vf,flc,vac->vla", unknown, places, across)
    misses[weights == 0] = np.nan
    scores = [sight.face.blendshapes for sight in sights]
    return Meant(
        attached,
        beside=places[0],
        drift=places[1:] if drift is None else drift,
        misses=misses,
        scores=np.mean(scores, axis=0) if scores else np.zeros(len(BLENDSHAPE_NAMES)),
    )


def viewpoint(
    R_cam_head: Float[Array, "3 3"], t_cam_head: Float[Array, " 3"]
) -> Float[Array, " 3"]:
    """Where a head is seen from: how far to its left and from above, and how near.

    The x and y of the direction to the camera, and 600 mm over its distance, less 1.
    """
    distance = float(np.linalg.norm(t_cam_head))
    x, y, _ = -R_cam_head.T @ t_cam_head / distance
    return np.array([x, y, _USUAL_MM / distance - 1])


def viewpoint_slopes(
    R_cam_head: Float[Array, "3 3"], t_cam_head: Float[Array, " 3"]
) -> Float[Array, "3 6"]:
    """Derivatives of the viewpoint by the pose (reconstruction.bundle.projection)."""
    distance = float(np.linalg.norm(t_cam_head))
    towards = t_cam_head / distance
    slopes = np.zeros((3, 6))
    slopes[:2, :3] = -(R_cam_head.T @ cross_matrix(towards))[:2]
    by_place = np.vstack(
        [
            -(R_cam_head.T @ (np.eye(3) - np.outer(towards, towards)))[:2] / distance,
            -_USUAL_MM / distance**2 * towards,
        ]
    )
    slopes[:, 3:] = by_place * [1.0, 1.0, t_cam_head[2]]
    return slopes


def _misses(sight: Sight, places: Float[Array, "l 3"]) -> Float[Array, "l 2"]:
    """(L, 2) mm, along the picture's axes, by which landmarks are seen off these places."""
    camera = sight.camera
    mm_per_px = camera.to_camera(places)[:, 2:] / camera.focal_px
    return (sight.face.points[:, :2] - camera.project(places)) * mm_per_px


def _regression(
    misses: Float[Array, "v l 2"],
    weights: Float[Array, "v l"],
    across: Float[Array, "v 2 3"],
    features: Float[Array, "v f"],
) -> Float[Array, "f l 3"]:
    """(F, L, 3) mm: how places depend on the features of the views, by least squares."""
    count = 3 * features.shape[1]
    rows = np.einsum("vf,vac->vafc", features, across).reshape(len(features), 2, count)
    matrix = np.einsum("vl,vai,vaj->lij", weights, rows, rows) + _HELD * np.eye(count)
    right = np.einsum("vl,vai,vla->li", weights, rows, misses)
    found = np.linalg.solve(matrix, right[..., None]).reshape(-1, features.shape[1], 3)
    return np.ascontiguousarray(found.transpose(1, 0, 2))


def facing(
    camera: Camera, places: Float[Array, "n 3"], normals: Float[Array, "n 3"]
) -> Float[Array, " n"]:
    """(N,) in [0, 1]: how far to trust landmarks at these places, mm, of a surface."""
    towards = camera.center - places
    return facing_share((normals * towards).sum(axis=1) / np.linalg.norm(towards, axis=1))


def facing_share(cosine: Float[Array, " n"]) -> Float[Array, " n"]:
    """(N,) of the angle between normal and view: the ramp of landmarks.facing_confidence."""
    return np.clip((cosine - 0.1) / 0.8, 0.0, 1.0)


def landmark_normals(generic: GenericHead, mesh: Mesh) -> Float[Array, "478 3"]:
    """(478, 3) unit normals of a head's surface at the places of the landmarks."""
    normals = at_landmarks(generic, mesh.vertex_normals())
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def at_landmarks(generic: GenericHead, values: Float[Array, "*k v c"]) -> Float[Array, "*k 478 c"]:
    """What vertices have, (..., V, C), at the places of the landmarks."""
    corners = generic.mesh.triangles[generic.landmark_triangles]
    return np.einsum("lc,...lcd->...ld", generic.landmark_barycentrics, values[..., corners, :])
