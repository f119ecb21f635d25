"""The rig of a head: photographed expressions, face units and gaze to one posed face."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, check_array
from mien.assets.generic import GenericHead, load_generic_head
from mien.errors import InputError
from mien.head import NEUTRAL, Head
from mien.limits import UNIT_RANGE
from mien.rig.basis import WEIGHT_RANGE, check_weights, outside_hull
from mien.rig.deformer import FaceDeformer
from mien.rig.regions import ENCLOSING_REGIONS, MASK_NAMES, check_masks, default_masks
from mien.rig.shading import OpeningMeter, brightness_at
from mien.rig.sparse_offsets import add_mixture
from mien.rig.state import FACE, FaceState, PosedFace
from mien.rig.unit_decomposition import UnitDecomposition

WEIGHTED_REGIONS = (*MASK_NAMES, FACE)
"""Regions that weights are resolved to; those of the face hold in the rest of the head."""


class Rig:
    """Poses the face of one head; everything that does not change is prepared once.

    Attributes:
        names: photographed expressions, neutral first: what the weights' columns stand for.
        textures: (h, w, 3) one for each name, of one size.
        offsets: (K, V, 3) mm from neutral to each of them, eyeballs where neutral has them.

    Raises:
        InputError: a head of another topology than the generic one's, no texture for neutral,
            textures of different sizes.

    Source:
        [Pighin 2002] sec. 6.1.1: consensus geometry, weights by region. Units, contacts and the
        residuals of expressions that follow the units are ours (docs/method/expressions.md).
    """

    def __init__(self, head: Head) -> None:
        generic = load_generic_head()
        if head.mesh.vertices.shape != generic.mesh.vertices.shape:
            expected = f"the generic head's {len(generic.mesh.vertices)} vertices"
            raise InputError("head", expected, len(head.mesh.vertices))
        self.names = (NEUTRAL, *(name for name in head.expressions if name != NEUTRAL))
        self.textures = _textures(head, self.names)
        self.unit_names = head.unit_names
        self._neutral = np.asarray(head.mesh.vertices, np.float64)
        units = np.asarray(head.units, np.float64)
        masks = check_masks(head.regions or default_masks(generic), len(self._neutral))
        by_mask = np.stack([masks[name] for name in MASK_NAMES], axis=1)
        self._masks = np.column_stack([by_mask, 1 - by_mask.sum(axis=1)])
        expressions = [head.expressions[name] for name in self.names]
        self._gaze = np.stack([item.gaze for item in expressions])
        self._deformer = FaceDeformer.of(generic, self._neutral, units)
        self.offsets = np.stack(
            [self._with_neutral_eyes(item.vertices) - self._neutral for item in expressions]
        )
        self._decomposition = UnitDecomposition.of(
            np.array([[item.units.get(n, 0.0) for n in self.unit_names] for item in expressions]),
            units,
            self.offsets,
            by_mask,
        )
        self._openings = OpeningMeter.of(generic, self._neutral)
        self._shading = head.shading
        self._photographed = np.stack([item.vertices for item in expressions])
        openings = np.stack([self._openings.measure(item) for item in self._photographed])
        self._photographed_brightness = brightness_at(openings, self._shading)
        self._shaded = _shaded_parts(generic)
        # Gaze in a photograph is independent of the units that it shows.
        self._skin_masks = self._masks.copy()
        for eyeball in self._deformer.gaze_model.eyeballs:
            self._skin_masks[eyeball.vertices] = 0

    def evaluate(self, state: FaceState, *, contacts: bool = True) -> PosedFace:
        """The face in this state.

        One expression at weight 1 is that expression exactly, as photographed.

        Args:
            state: expressions, units and gaze.
            contacts: whether to resolve contacts of lids, eyes and lips.

        Raises:
            InputError: an unknown region, expression or unit; weights outside [-0.5, 1.5].
        """
        gaze = np.array([state.gaze.yaw, state.gaze.pitch])
        by_region = self._region_weights(state.expressions)
        return self.posed(by_region, self._unit_weights(state.units), gaze, contacts=contacts)

    def posed(
        self,
        by_region: Float[Array, "r k"],
        units: Float[Array, " u"],
        gaze: Float[Array, " 2"],
        *,
        contacts: bool = True,
    ) -> PosedFace:
        """As evaluate, from arrays that are not checked.

        Args:
            by_region: weights of the expressions in each of WEIGHTED_REGIONS.
            units: weights.
            gaze: yaw and pitch, radians.
            contacts: as for evaluate.
        """
        weights = self._masks @ by_region
        moved = bool(units.any() or gaze.any())
        if not moved and _one_expression(by_region):
            return self._as_photographed(weights)
        vertices = self._mixed(weights)
        following = self._decomposition.expression_weights(units) * np.clip(by_region[:, :1], 0, 1)
        if following.any():
            added = self._skin_masks @ np.column_stack([-following.sum(axis=1), following])
            add_mixture(added[:, 1:], self._decomposition.residuals[1:], vertices)
            weights += added
        vertices = self._deformer.deform(vertices, units, gaze, contacts=contacts)
        return PosedFace(vertices, weights, self._brightness(vertices, weights))

    def mixed(
        self,
        weights: Float[Array, "v k"],
        offsets: Float[Array, "v 3"] | None = None,
        *,
        turn: Float[Array, "2 2"] | None = None,
        contacts: bool = True,
    ) -> PosedFace:
        """The face with weights of the photographed expressions for every vertex.

        One expression at weight 1 everywhere is that expression exactly, as photographed.

        Args:
            weights: (V, K) that sum to 1; equal within an eyeball.
            offsets: (V, 3) mm, added to the mixed face.
            turn: radians, yaw and pitch added to the left and the right eye.
            contacts: as for evaluate.

        Raises:
            InputError: shape, not finite.
        """
        shape = (len(self._neutral), len(self.names))
        weights = check_array("weights", weights, shape)
        if offsets is None and turn is None and _one_expression(weights):
            return self._as_photographed(weights)
        vertices = self._mixed(weights)
        if turn is not None:
            self._deformer.gaze_model.turn(vertices, check_array("turn", turn, (2, 2)))
        if offsets is not None:
            vertices += check_array("offsets", offsets, vertices.shape)
        still = np.zeros(len(self.unit_names))
        vertices = self._deformer.deform(vertices, still, contacts=contacts)
        return PosedFace(vertices, weights, self._brightness(vertices, weights))

    def mask(self, region: str) -> Float[Array, " v"]:
        """(V,) in [0, 1]: influence of this region's weights on each vertex.

        Raises:
            InputError: an unknown region.
        """
        _check_known("region", region, ENCLOSING_REGIONS)
        inside = [region in (name, *ENCLOSING_REGIONS[name]) for name in MASK_NAMES]
        return self._masks[:, [*inside, region == FACE]].sum(axis=1)

    def hull_notes(self, state: FaceState) -> tuple[str, ...]:
        """Notes on weights of a state that extrapolate the photographed expressions, by region.

        Raises:
            InputError: as evaluate.
        """
        self._region_weights(state.expressions)
        self._unit_weights(state.units)
        weights = {region: self._weights(given) for region, given in state.expressions.items()}
        notes = {region: outside_hull(row, self.names) for region, row in weights.items()}
        return tuple(f"{region}: {note}" for region, note in notes.items() if note)

    def _region_weights(
        self, expressions: Mapping[str, Mapping[str, float]]
    ) -> Float[Array, "r k"]:
        """(R, K) weights in each of WEIGHTED_REGIONS."""
        rows = region_rows(tuple(expressions))
        own = [self._weights({}), *(self._weights(given) for given in expressions.values())]
        return np.array(own)[rows]

    def _weights(self, given: Mapping[str, float]) -> Float[Array, " k"]:
        weights = np.zeros(len(self.names))
        for name, weight in given.items():
            _check_known("expression", name, self.names)
            weights[self.names.index(name)] = weight
        if NEUTRAL not in given:
            weights[0] = 1 - weights.sum()
        low, high = WEIGHT_RANGE
        for name in (*given, NEUTRAL):
            weight = weights[self.names.index(name)]
            if not low - 1e-6 <= weight <= high + 1e-6:
                raise InputError(f"weight of {name}", f"{low} to {high}", f"{weight:g}")
        return check_weights(weights)

    def _unit_weights(self, given: Mapping[str, float]) -> Float[Array, " u"]:
        weights = np.zeros(len(self.unit_names))
        for name, weight in given.items():
            _check_known("unit", name, self.unit_names)
            low, high = UNIT_RANGE
            if not low - 1e-6 <= weight <= high + 1e-6:
                percent = "; weights in percent?" if high < abs(weight) <= 100 else ""
                raise InputError(f"unit {name}", f"{low} to {high}", f"{weight:g}{percent}")
            weights[self.unit_names.index(name)] = weight
        return weights

    def _with_neutral_eyes(self, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
        """The expression with its eyeballs as in neutral: they are rotated, not mixed."""
        still = np.array(vertices, np.float64)
        for eyeball in self._deformer.gaze_model.eyeballs:
            still[eyeball.vertices] = self._neutral[eyeball.vertices]
        return still

    def _as_photographed(self, weights: Float[Array, "v k"]) -> PosedFace:
        """The expression that has weight 1 everywhere."""
        vertices = self._photographed[int(weights[0].argmax())]
        return PosedFace(vertices, weights, self._brightness(vertices, weights))

    def _mixed(self, weights: Float[Array, "v k"]) -> Float[Array, "v 3"]:
        vertices = self._neutral.copy()
        add_mixture(weights[:, 1:], self.offsets[1:], vertices)
        self._turn_eyes_as_photographed(vertices, weights)
        return vertices

    def _turn_eyes_as_photographed(
        self, vertices: Float[Array, "v 3"], weights: Float[Array, "v k"]
    ) -> None:
        """Rotates the eyes in place by the weighted mean of the gaze in the photographs."""
        gaze_model = self._deformer.gaze_model
        balls = [eyeball.vertices[0] for eyeball in gaze_model.eyeballs]
        gaze_model.turn(vertices, np.einsum("sk,ksa->sa", weights[balls], self._gaze))

    def _brightness(
        self, vertices: Float[Array, "v 3"], weights: Float[Array, "v k"]
    ) -> Float[Array, " v"]:
        """(V,) shadow ([Pighin 2002] sec. 5.2.4), relative to that in the mixed textures."""
        now = brightness_at(self._openings.measure(vertices), self._shading)
        brightness = np.ones(len(vertices))
        for column, part in enumerate(self._shaded):
            there = weights[part[0]] @ self._photographed_brightness[:, column]
            brightness[part] = now[column] / max(float(there), 0.1)
        return brightness


def region_rows(regions: Sequence[str]) -> Int[Array, " r"]:
    """(R,) for each of WEIGHTED_REGIONS the nearest of these, counted from 1; 0 for none.

    Raises:
        InputError: an unknown region.
    """
    for region in regions:
        _check_known("region", region, ENCLOSING_REGIONS)
    nearest = (
        next((name for name in (own, *ENCLOSING_REGIONS[own]) if name in regions), None)
        for own in WEIGHTED_REGIONS
    )
    return np.array([0 if name is None else 1 + regions.index(name) for name in nearest])


def _textures(head: Head, names: Iterable[str]) -> tuple[UInt8[Array, "h w 3"], ...]:
    """One for each expression; neutral's for one that has none."""
    own = {name: head.textures.get(head.expressions[name].texture) for name in names}
    neutral = own[NEUTRAL]
    if neutral is None:
        raise InputError("head", "a texture of neutral", ", ".join(head.textures) or "none")
    for name, texture in own.items():
        if texture is not None and texture.shape != neutral.shape:
            expected = f"{neutral.shape[1]}x{neutral.shape[0]} as neutral's"
            found = f"{texture.shape[1]}x{texture.shape[0]}"
            raise InputError(f"texture of {name}", expected, found)
    return tuple(neutral if texture is None else texture for texture in own.values())


def _shaded_parts(generic: GenericHead) -> tuple[Array, Array, Array]:
    """Vertices of the left eye, the right eye, and of teeth and tongue."""
    return (
        generic.mesh.vertices_of("left_eyeball"),
        generic.mesh.vertices_of("right_eyeball"),
        generic.mesh.vertices_of("upper_teeth", "lower_teeth", "tongue"),
    )


def _one_expression(weights: Float[Array, "n k"]) -> bool:
    """Whether the face is one photographed expression, everywhere the same."""
    return bool(np.count_nonzero(weights[0]) == 1 and (weights == weights[0]).all())


def _check_known(what: str, name: str, known: Iterable[str]) -> None:
    known = tuple(known)
    if name not in known:
        close = difflib.get_close_matches(name, known, n=3) or known[:6]
        raise InputError(what, f"one of the head's, such as {', '.join(close)}", name)
