"""The face model of one head, linear in its parameters around an anchor."""

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
from mien.track.photometric.normal_equations import pose_support
from mien.track.photometric.range_penalty import RangeLimits
from mien.track.photometric.samples import ParameterSupport
from mien.track.state import Layout

REGIONS = ("mouth", "eyes", "forehead")
"""[Pighin 2002]'s three (sec. 6.2, fig. 9)."""
BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")
"""Units that a head with photographed expressions has in addition."""
_NOT_TRACKED = ("tongueOut", "mouthClose", "jawForward")
"""Units that a front view hardly determines."""
_EYEBALLS = ("left_eyeball", "right_eyeball")
_MIN_UNIT = 0.1
"""Weight of a unit below which it is taken for noise."""
_MIN_MM = 0.05
"""A parameter that moves a vertex by less than this at 1 does not affect it."""


@dataclass(frozen=True)
class FaceParameters:
    """Expression and gaze of a face, as the unknowns that are solved for.

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

    def plus(self, step: Float[Array, " p"]) -> FaceParameters:
        """After a step in all of them."""
        ends = [self.alpha.size, self.alpha.size + len(self.units)]
        alpha, units, gaze = np.split(self.vector + step, ends)
        return FaceParameters(alpha.reshape(self.alpha.shape), units, gaze)


@dataclass(frozen=True)
class Anchor:
    """The rig's face at given parameters, around which the model is linear.

    Attributes:
        parameters: of the face.
        face: as the rig poses it, with contacts and shadows.
    """

    parameters: FaceParameters
    face: PosedFace


class FaceModel:
    """One head, prepared for tracking.

    Attributes:
        layout: of its numbers.
        basis: between blending weights and parameters, [Pighin 2002] eq. (4).
        limits: of the parameters.
        painted: triangles that can be seen, with their textures.
        grey: the same textures in grey.
        compared: (F,) bool: triangles of the face, whose pixels are compared.
        offsets: (P, V, 3) mm by which a step of 1 in each parameter moves each vertex.
        support: which unknowns affect which triangles.
        pose_support: the same for the pose alone.
        region_of: (F,) the region that each triangle belongs to most; -1 for none.

    Args:
        head: that is tracked.
        units: names of face units; by default blinks for a head with photographed expressions, and
            all that a front view shows for one without.
        regions: whose expressions are independent.

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
        mesh, self.compared = _visible_triangles(head.mesh, load_generic_head().regions)
        self.limits = RangeLimits.of(self.basis, len(regions), len(units))
        self.painted = prepare_textured_mesh(mesh, build_pyramids(self.rig.textures))
        self.grey = grey_pyramids(self.painted.pyramids)
        self._masks = np.stack([self.rig.mask(region) for region in regions], axis=1)
        self._rows = region_rows(self.layout.regions)
        self._neutral_weights = np.eye(1, len(self.rig.names))
        self._units = [head.unit_names.index(name) for name in units]
        offsets = [*self._expression_offsets(), *np.asarray(head.units[self._units], np.float64)]
        offsets += _gaze_offsets(head.mesh)
        self.offsets = frozen(np.stack(offsets))
        self._sparse_offsets = SparseOffsets.of(self.offsets)
        self.support = self._support()
        self.pose_support = pose_support(self.painted.triangles)
        coverage = self._masks[mesh.triangles].mean(axis=1)
        self.region_of = frozen(np.where(coverage.max(axis=1) > 0, coverage.argmax(axis=1), -1))

    @cached_property
    def neutral(self) -> FaceParameters:
        """Neutral in every region, eyes straight ahead."""
        weights = np.eye(len(self.layout.expressions))[np.zeros(len(self.layout.regions), int)]
        return FaceParameters(
            self.basis.alpha(weights), np.zeros(len(self.layout.units)), np.zeros(2)
        )

    def weights(self, parameters: FaceParameters) -> Float[Array, "r k"]:
        """Blending weights by region: w = Q alpha + w*, within WEIGHT_RANGE."""
        return within_range(self.basis.weights(parameters.alpha))

    def anchored(self, parameters: FaceParameters) -> Anchor:
        """The rig's face at these parameters."""
        # Units bring photographed expressions along (rig.rig); noise must not.
        significant = np.where(np.abs(parameters.units) > _MIN_UNIT, parameters.units, 0.0)
        parameters = FaceParameters(parameters.alpha, significant, parameters.gaze)
        by_region = np.vstack([self._neutral_weights, self.weights(parameters)])[self._rows]
        units = np.zeros(len(self.rig.unit_names))
        units[self._units] = parameters.units
        return Anchor(parameters, self.rig.posed(by_region, units, parameters.gaze))

    def posed(self, anchor: Anchor, parameters: FaceParameters) -> PosedFace:
        """The face at other parameters near by, linear around the anchor.

        Raises:
            InputError: not finite.
        """
        step = check_array("parameters", parameters.vector, (None,)) - anchor.parameters.vector
        if not step.any():
            return anchor.face
        vertices = anchor.face.vertices.copy()
        self._sparse_offsets.add(step, vertices)
        weights = self._masks @ ((parameters.alpha - anchor.parameters.alpha) @ self.basis.Q.T)
        weights += anchor.face.weights
        return PosedFace(vertices, weights, anchor.face.brightness, finite=False)

    def _expression_offsets(self) -> list[Float[Array, "v 3"]]:
        """[Pighin 2002] app. B.2: dm/dalpha = sum over k of Q(k, l) m_k, in each region by mask."""
        along = np.tensordot(self.basis.Q.T, self.rig.offsets, axes=1)
        return [mask[:, None] * move for mask in self._masks.T for move in along]

    def _support(self) -> ParameterSupport:
        regions, directions = len(self.layout.regions), self.basis.Q.shape[1]
        mixing, triangles = regions * directions, self.painted.triangles
        region, direction = np.full((2, POSE_UNKNOWNS + len(self.offsets)), -1)
        own = slice(POSE_UNKNOWNS, POSE_UNKNOWNS + mixing)
        region[own], direction[own] = np.divmod(np.arange(mixing), max(directions, 1))
        affected = np.linalg.norm(self.offsets, axis=2) > _MIN_MM
        affected[:mixing] |= self._masks.T[region[own]] > 0
        every = np.ones((POSE_UNKNOWNS, len(triangles)), bool)
        by_triangle = np.vstack([every, affected[:, triangles].any(axis=2)]).T
        rows, set_of = np.unique(by_triangle, axis=0, return_inverse=True)
        sizes = rows.sum(axis=1)
        sets = np.argsort(~rows, axis=1, kind="stable")[:, : sizes.max()]
        sets, sizes, set_of, region, direction = (
            frozen(np.ascontiguousarray(array, np.int32))
            for array in (sets, sizes, set_of.ravel(), region, direction)
        )
        Q, masks = (frozen(array.astype(np.float32)) for array in (self.basis.Q, self._masks))
        return ParameterSupport(sets, sizes, set_of, region, direction, Q, masks, triangles)


def within_range(weights: Float[Array, "r k"]) -> Float[Array, "r k"]:
    """Weights that sum to 1, scaled towards the mean expression until none is out of range."""
    low, high = WEIGHT_RANGE
    mean = 1 / weights.shape[1]
    farthest = np.maximum((weights - mean) / (high - mean), (weights - mean) / (low - mean))
    return mean + (weights - mean) / np.maximum(farthest.max(axis=1, keepdims=True), 1)


def _is_expressive(unit: str) -> bool:
    return unit not in _NOT_TRACKED and not unit.startswith("eyeLook")


def _visible_triangles(mesh: Mesh, regions: Mapping[str, Array]) -> tuple[Mesh, Bool[Array, " f"]]:
    """The triangles around the face, and which of them are compared.

    Without hair, ears and neck: their shapes vary, and they do not occlude the face.
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
        counted[mesh.vertices_of(part)] = True
    return near, counted[near.triangles].all(axis=1)


def _gaze_offsets(mesh: Mesh) -> list[Float[Array, "v 3"]]:
    """Derivatives of the eyeballs' vertices by yaw and by pitch, mm / rad."""
    offsets = []
    for axis in ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)):
        move = np.zeros_like(mesh.vertices, np.float64)
        for part in _EYEBALLS:
            ball = mesh.vertices_of(part)
            move[ball] = np.cross(axis, mesh.vertices[ball] - mesh.vertices[ball].mean(axis=0))
        offsets.append(move)
    return offsets
