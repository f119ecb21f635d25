"""The head that is compared with pictures, and how its face answers to every parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, check_array, frozen
from mien.assets.generic import load_generic_head
from mien.errors import InputError
from mien.head import Head
from mien.mesh import Mesh
from mien.render.mipmap import build_pyramids
from mien.render.multitexture import prepare_textured_mesh
from mien.rig.basis import WEIGHT_RANGE, Basis
from mien.rig.rig import Rig, region_rows
from mien.rig.sparse_offsets import SparseOffsets
from mien.rig.state import PosedFace
from mien.track.image.greyscale import grey_pyramids
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS
from mien.track.photometric.normal_equations import pose_answers
from mien.track.photometric.range_penalty import Limits
from mien.track.photometric.samples import Answers
from mien.track.state import Layout

REGIONS = ("mouth", "eyes", "forehead")
"""[Pighin 2002]'s three (sec. 6.2, fig. 9)."""
BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")
"""Units that a head with photographed expressions has in addition."""
_STILL = ("tongueOut", "mouthClose", "jawForward")
"""Units that a front view says too little of."""
_EYEBALLS = ("left_eyeball", "right_eyeball")
_LEAST_UNIT = 0.1
_LEAST_MM = 0.05
"""A parameter that moves a vertex by less than this at 1 does not concern it."""


@dataclass(frozen=True)
class FaceParameters:
    """What a face does, as the numbers that are solved for.

    Attributes:
        alpha: (R, K - 1) expression parameters by region, [Pighin 2002] eq. (4).
        units: (U,) weights.
        gaze: (2,) radians, yaw to the subject's left and pitch up.
    """

    alpha: Float[Array, "r l"]
    units: Float[Array, " u"]
    gaze: Float[Array, " 2"]

    @cached_property
    def vector(self) -> Float[Array, " p"]:
        """(P,) all of them, in this order."""
        return frozen(np.concatenate([self.alpha.ravel(), self.units, self.gaze]))

    def moved(self, step: Float[Array, " p"]) -> FaceParameters:
        """After a step in all of them."""
        ends = [self.alpha.size, self.alpha.size + len(self.units)]
        alpha, units, gaze = np.split(self.vector + step, ends)
        return FaceParameters(alpha.reshape(self.alpha.shape), units, gaze)


@dataclass(frozen=True)
class Anchor:
    """The rig's own face, around which the rest is linear: its contacts and shadows are kept.

    Attributes:
        at: its parameters.
        face: what the rig makes of them.
    """

    at: FaceParameters
    face: PosedFace


class TrackedFace:
    """One head, prepared for being drawn and compared many times.

    Attributes:
        layout: of its numbers.
        basis: between blending weights and parameters, [Pighin 2002] eq. (4).
        limits: what the parameters are to stay within.
        painted: triangles that can be seen, with their textures.
        grey: these in grey.
        compared: (F,) bool: those of the face, whose pixels count.
        moves: (P, V, 3) mm by which a step of 1 in each parameter moves each vertex.
        answers: which unknowns concern which triangles.
        pose_answers: of the pose's alone.
        region_of: (F,) the region that each triangle belongs to most; -1 for none.

    Raises:
        InputError: as Rig; an unknown region or unit.
    """

    def __init__(
        self, head: Head, *, units: Sequence[str] | None = None, regions: Sequence[str] = REGIONS
    ) -> None:
        self.rig = Rig(head)
        if units is None:
            expressive = tuple(name for name in head.unit_names if _is_expressive(name))
            units = BLINKS if len(self.rig.names) > 1 else expressive
        unknown = [name for name in units if name not in head.unit_names]
        if unknown:
            raise InputError("units", f"some of {', '.join(head.unit_names)}", unknown[0])
        self.layout = Layout(tuple(regions), self.rig.names, tuple(units))
        self.basis = Basis.by_gram_schmidt(len(self.rig.names))
        mesh, self.compared = _seen(head.mesh, load_generic_head().regions)
        self.limits = Limits.of(self.basis, len(regions), len(units))
        self.painted = prepare_textured_mesh(mesh, build_pyramids(self.rig.textures))
        self.grey = grey_pyramids(self.painted.pyramids)
        self._masks = np.stack([self.rig.mask(region) for region in regions], axis=1)
        self._rows = region_rows(self.layout.regions)
        self._neutral_weights = np.eye(1, len(self.rig.names))
        self._units = [head.unit_names.index(name) for name in units]
        moves = [*self._expression_moves(), *np.asarray(head.units[self._units], np.float64)]
        moves += _gaze_moves(head.mesh)
        self.moves = frozen(np.stack(moves))
        self._sparse_moves = SparseOffsets.of(self.moves)
        self.answers = self._answers()
        self.pose_answers = pose_answers(self.painted.triangles)
        shares = self._masks[mesh.triangles].mean(axis=1)
        self.region_of = frozen(np.where(shares.max(axis=1) > 0, shares.argmax(axis=1), -1))

    @cached_property
    def neutral(self) -> FaceParameters:
        """Neutral in every region, eyes straight ahead."""
        weights = np.eye(len(self.layout.expressions))[np.zeros(len(self.layout.regions), int)]
        return FaceParameters(
            self.basis.alpha(weights), np.zeros(len(self.layout.units)), np.zeros(2)
        )

    def weights(self, parameters: FaceParameters) -> Float[Array, "r k"]:
        """Blending weights by region: w = Q alpha + w*; never beyond what a face may have."""
        return within_range(self.basis.weights(parameters.alpha))

    def anchored(self, parameters: FaceParameters) -> Anchor:
        """The rig's face at these parameters."""
        # What is noise alone must not bring a photographed expression along (rig.rig).
        sure = np.where(np.abs(parameters.units) > _LEAST_UNIT, parameters.units, 0.0)
        parameters = FaceParameters(parameters.alpha, sure, parameters.gaze)
        by_region = np.vstack([self._neutral_weights, self.weights(parameters)])[self._rows]
        units = np.zeros(len(self.rig.unit_names))
        units[self._units] = parameters.units
        return Anchor(parameters, self.rig.posed(by_region, units, parameters.gaze))

    def posed(self, anchor: Anchor, parameters: FaceParameters) -> PosedFace:
        """The face at other parameters near by: the anchor's and the sum of what they change.

        Raises:
            InputError: not finite.
        """
        step = check_array("parameters", parameters.vector, (None,)) - anchor.at.vector
        if not step.any():
            return anchor.face
        vertices = anchor.face.vertices.copy()
        self._sparse_moves.add(step, vertices)
        weights = self._masks @ ((parameters.alpha - anchor.at.alpha) @ self.basis.Q.T)
        weights += anchor.face.weights
        return PosedFace(vertices, weights, anchor.face.brightness, finite=False)

    def _expression_moves(self) -> list[Float[Array, "v 3"]]:
        """[Pighin 2002] app. B.2: dm/dalpha = sum over k of Q(k, l) m_k, in each region by mask."""
        along = np.tensordot(self.basis.Q.T, self.rig.offsets, axes=1)
        return [mask[:, None] * move for mask in self._masks.T for move in along]

    def _answers(self) -> Answers:
        regions, directions = len(self.layout.regions), self.basis.Q.shape[1]
        mixing, triangles = regions * directions, self.painted.triangles
        region, direction = np.full((2, POSE_UNKNOWNS + len(self.moves)), -1)
        own = slice(POSE_UNKNOWNS, POSE_UNKNOWNS + mixing)
        region[own], direction[own] = np.divmod(np.arange(mixing), max(directions, 1))
        concerned = np.linalg.norm(self.moves, axis=2) > _LEAST_MM
        concerned[:mixing] |= self._masks.T[region[own]] > 0
        every = np.ones((POSE_UNKNOWNS, len(triangles)), bool)
        by_triangle = np.vstack([every, concerned[:, triangles].any(axis=2)]).T
        rows, set_of = np.unique(by_triangle, axis=0, return_inverse=True)
        sizes = rows.sum(axis=1)
        sets = np.argsort(~rows, axis=1, kind="stable")[:, : sizes.max()]
        sets, sizes, set_of, region, direction = (
            frozen(np.ascontiguousarray(array, np.int32))
            for array in (sets, sizes, set_of.ravel(), region, direction)
        )
        Q, masks = (frozen(array.astype(np.float32)) for array in (self.basis.Q, self._masks))
        return Answers(sets, sizes, set_of, region, direction, Q, masks, triangles)


def within_range(weights: Float[Array, "r k"]) -> Float[Array, "r k"]:
    """Weights that sum to 1, drawn towards the mean expression until none lies out of range."""
    low, high = WEIGHT_RANGE
    mean = 1 / weights.shape[1]
    farthest = np.maximum((weights - mean) / (high - mean), (weights - mean) / (low - mean))
    return mean + (weights - mean) / np.maximum(farthest.max(axis=1, keepdims=True), 1)


def _is_expressive(unit: str) -> bool:
    return unit not in _STILL and not unit.startswith("eyeLook")


def _seen(mesh: Mesh, regions: Mapping[str, Array]) -> tuple[Mesh, Bool[Array, " f"]]:
    """The triangles that a picture of the face can show, and which of them are compared.

    Hair, ears and neck have other shapes in every picture; behind the face they hide nothing.
    """
    inner = [part for part in mesh.part_names if part not in ("skin", "hair", "lashes")]
    skin = mesh.triangles[mesh.triangles_of("skin")]
    inside = np.maximum.reduce([regions[name] for name in ("face", "eye_socket", "mouth_cavity")])
    near = mesh.submesh(
        np.concatenate(
            [
                mesh.triangles_of("skin")[(inside[skin] > 0.05).any(axis=1)],
                mesh.triangles_of(*inner),
            ]
        )
    )
    apart = regions["scalp"] + regions["neck"]
    counted = (inside > 0.5) & (apart < 0.2)
    for part in inner:
        counted[np.unique(mesh.triangles[mesh.triangles_of(part)])] = True
    return near, counted[near.triangles].all(axis=1)


def _gaze_moves(mesh: Mesh) -> list[Float[Array, "v 3"]]:
    """What a radian of yaw and of pitch would do to the eyeballs, were it a straight way."""
    moves = []
    for axis in ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)):
        move = np.zeros_like(mesh.vertices, np.float64)
        for part in _EYEBALLS:
            ball = np.unique(mesh.triangles[mesh.triangles_of(part)])
            move[ball] = np.cross(axis, mesh.vertices[ball] - mesh.vertices[ball].mean(axis=0))
        moves.append(move)
    return moves
